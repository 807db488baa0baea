import weakref
from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from vnca.engine import backend_named
from vnca.engine.automaton import Weights, changing_rows, stencil
from vnca.engine.domain import Domain
from vnca.training.rollout import fewest_kept, layout, roll_out


@settings(deadline=None)
@given(steps=st.integers(1, 100), more=st.integers(0, 60))
def test_no_more_states_are_kept_than_there_is_room_for(steps: int, more: int) -> None:
    room = fewest_kept(steps) + more
    length, kept = layout(steps, room)
    starts = list(range(0, steps - kept, length))
    assert len(starts) + kept <= room  # when the rollout ends
    assert len(starts) + length - 1 <= room or not starts  # when a segment is computed again
    with pytest.raises(ValueError, match="room"):
        layout(steps, fewest_kept(steps) - 1)


def test_nothing_is_computed_again_where_there_is_room_for_all() -> None:
    assert layout(24, 24)[1] == layout(24, inf)[1] == 24
    assert layout(24, 23)[1] == 22  # two steps, of which one state is kept


def test_the_fewest_states_grow_with_the_root_of_the_steps() -> None:
    assert [fewest_kept(steps) for steps in (1, 2, 16, 64, 100)] == [1, 2, 7, 15, 19]


@pytest.fixture
def automaton() -> Callable[[str], tuple[Callable[[Tensor, int], Tensor], Tensor, Weights]]:
    """A step of a random rule on 6×7×8 cells, a state to begin with, and the rule's weights."""

    def make(backend: str) -> tuple[Callable[[Tensor, int], Tensor], Tensor, Weights]:
        domain = Domain.from_mask(np.ones((6, 7, 8), bool), (0, 0, 0))
        random = torch.Generator().manual_seed(0)

        def drawn(*shape: int) -> Tensor:
            return 0.2 * torch.randn(shape, generator=random)

        weights = Weights(*(drawn(*s).requires_grad_() for s in ((16, 37), (16,), (6, 16))))
        state = drawn(len(domain) + 1, 6)
        state[-1] = 0
        step = backend_named(backend).update()
        around = torch.from_numpy(domain.neighbours), drawn(len(domain), 7)
        filters = torch.from_numpy(stencil())

        def advance(state: Tensor, number: int) -> Tensor:
            rows = changing_rows(domain.hashes, seed=1, step=number, probability=0.5)
            return step(state, torch.from_numpy(rows), *around, weights, filters)

        return advance, state.requires_grad_(), weights

    return make


@pytest.mark.parametrize("backend", ["native", "reference"])
@pytest.mark.parametrize("room", [11, 7, 6])
def test_gradients_are_those_of_a_rollout_that_keeps_all_to_the_bit(
    automaton: Any, backend: str, room: int
) -> None:
    advance, state, weights = automaton(backend)
    results = []
    for kept_states in (inf, room):
        end = roll_out(advance, state, range(40, 52), kept_states=kept_states)
        gradients = torch.autograd.grad(end[:-1].square().sum(), (state, *weights))
        results.append((end, *gradients))
    for plain, frugal in zip(*results, strict=True):
        assert plain.any()
        assert torch.equal(plain, frugal)


class Held:
    """Steps whose states are counted as long as anything holds them."""

    def __init__(self) -> None:
        self.alive = self.most = self.calls = 0

    def state(self, values: Any) -> Tensor:
        array = np.array(values)
        weakref.finalize(array, self._gone)
        self.alive += 1
        self.most = max(self.most, self.alive)
        return torch.from_numpy(array)

    def _gone(self) -> None:
        self.alive -= 1

    def advance(self, state: Tensor, _: int) -> Tensor:
        self.calls += 1
        held = self

        class Step(torch.autograd.Function):
            @staticmethod
            def forward(ctx: Any, state: Tensor) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
                ctx.save_for_backward(state)
                return held.state(state.numpy() + 1)

            @staticmethod
            def backward(ctx: Any, *grad_outputs: Tensor) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
                (state,) = ctx.saved_tensors
                return grad_outputs[0] * state / 20

        result = Step.apply(state)
        assert isinstance(result, Tensor)
        return result


@pytest.mark.parametrize(("room", "again"), [(inf, 0), (24, 28), (15, 40)])
def test_states_beyond_the_room_are_let_go_and_come_again(room: float, again: int) -> None:
    held = Held()
    start = torch.ones(3, requires_grad=True)
    end = roll_out(held.advance, start, range(40), kept_states=room)
    end.sum().backward()
    assert start.grad is not None
    np.testing.assert_allclose(start.grad, float(np.prod(np.arange(1.0, 41) / 20)), rtol=1e-5)
    assert held.calls <= 40 + again
    assert held.most <= min(room, 40) + 2


def test_a_rollout_without_gradient_keeps_nothing() -> None:
    held = Held()
    with torch.no_grad():
        roll_out(held.advance, torch.ones(3), range(40), kept_states=1)
    assert held.most <= 2
    assert held.calls == 40
