"""The relaxed earth mover's distance between two sets of features."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional

from vnca.losses.style import cosine_cost, sample_positions, style_distance


def features(count: int, channels: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(count, channels, generator=generator, dtype=torch.float64)


def distance_by_loops(x: torch.Tensor, y: torch.Tensor) -> float:
    def cost(a: list[float], b: list[float]) -> float:
        inner = sum(i * j for i, j in zip(a, b, strict=True))
        return 1 - inner / math.hypot(*a) / math.hypot(*b)

    def one_way(these: list[list[float]], those: list[list[float]]) -> float:
        return sum(min(cost(a, b) for b in those) for a in these) / len(these)

    return max(one_way(x.tolist(), y.tolist()), one_way(y.tolist(), x.tolist()))


@settings(deadline=None, max_examples=30)
@given(
    n=st.integers(1, 8), m=st.integers(1, 8), c=st.integers(1, 5), seed=st.integers(0, 2**31 - 1)
)
def test_agrees_with_the_definition(n: int, m: int, c: int, seed: int) -> None:
    # Of one length: beside zero, where directions have no meaning, the distance is smoothed.
    x, y = (functional.normalize(features(k, c, s)) for k, s in ((n, seed), (m, seed + 1)))
    assert style_distance(x, y).item() == pytest.approx(distance_by_loops(x, y), abs=1e-6)


def test_identical_sets_are_at_distance_zero() -> None:
    x = features(50, 16, seed=0)
    assert style_distance(x, x).item() == pytest.approx(0, abs=1e-12)


def test_lengths_of_vectors_do_not_matter() -> None:
    x = features(50, 16, seed=0)
    assert style_distance(x, 3 * x).item() == pytest.approx(0, abs=1e-12)


def test_order_does_not_matter() -> None:
    x, y = features(40, 8, seed=1), features(30, 8, seed=2)
    order = torch.randperm(40, generator=torch.Generator().manual_seed(3))
    torch.testing.assert_close(style_distance(x[order], y), style_distance(x, y))


def test_both_directions_count() -> None:
    few = torch.eye(4, dtype=torch.float64)[:1]
    many = torch.eye(4, dtype=torch.float64)
    # Every vector of `few` is found in `many`, three of four not the other way round.
    assert style_distance(few, many).item() == pytest.approx(0.75)
    assert style_distance(many, few).item() == pytest.approx(0.75)


def test_gradient_is_that_of_the_value() -> None:
    x = features(7, 5, seed=4).requires_grad_()
    y = features(6, 5, seed=5).requires_grad_()
    assert torch.autograd.gradcheck(style_distance, (x, y))


def test_zero_vectors_have_finite_gradients() -> None:
    x = torch.zeros(5, 8, requires_grad=True)
    style_distance(x, torch.zeros(3, 8)).backward()
    assert x.grad is not None
    assert torch.isfinite(x.grad).all()


def test_zero_vectors_cost_one() -> None:
    assert cosine_cost(torch.zeros(1, 3), torch.ones(1, 3)).item() == 1


def test_positions_are_drawn_without_repetition_and_by_the_seed() -> None:
    first = sample_positions(1000, 100, torch.Generator().manual_seed(0))
    again = sample_positions(1000, 100, torch.Generator().manual_seed(0))
    other = sample_positions(1000, 100, torch.Generator().manual_seed(1))
    assert len(set(first.tolist())) == 100
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


def test_few_positions_are_all_taken() -> None:
    generator = torch.Generator().manual_seed(0)
    assert sample_positions(7, 7, generator).tolist() == list(range(7))
