import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.automaton.domain import Domain, dilate
from vnca.errors import OptionError
from vnca.kernels.update.stencil import OFFSETS
from vnca.typing import Box


def random_domain(seed: int, shape: tuple[int, int, int], border: str = "replicate") -> Domain:
    alive = np.random.default_rng(seed).random(shape) < 0.6
    alive[0, 0, 0] = True
    return Domain.from_mask(alive, (-2, 5, -9), border=border)  # type: ignore[arg-type]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.tuples(*[st.integers(1, 10)] * 3))
def test_scattering_and_gathering_are_inverse(seed: int, shape: tuple[int, int, int]) -> None:
    domain = random_domain(seed, shape)
    values = np.random.default_rng(seed).random((len(domain), 2)).astype(np.float32)
    dense = domain.scatter(values, domain.box)
    np.testing.assert_array_equal(domain.gather(dense, domain.box.lower), values)
    assert np.count_nonzero(dense) == np.count_nonzero(values)


@pytest.mark.parametrize("border", ["replicate", "circular"])
def test_neighbours_are_the_cells_around_repeated_or_wrapped_at_the_border(border: str) -> None:
    domain = random_domain(4, (4, 3, 5), border)
    rows = {tuple(cell): row for row, cell in enumerate(domain.cells.tolist())}
    lower, shape = np.array(domain.box.lower), np.array(domain.box.shape)
    for k, offset in enumerate(OFFSETS):
        for row, cell in enumerate(domain.cells):
            at = cell + offset - lower
            at = np.clip(at, 0, shape - 1) if border == "replicate" else at % shape
            expected = rows.get(tuple((at + lower).tolist()), len(domain))
            assert domain.neighbours[k, row] == expected


def test_cells_are_listed_brick_by_brick() -> None:
    domain = Domain.from_mask(np.ones((16, 16, 16), bool), (0, 0, 0))
    bricks = (domain.cells // 8) @ [4, 2, 1]
    assert np.all(np.diff(bricks) >= 0)
    assert np.all(np.bincount(bricks) == 512)


def test_a_state_keeps_its_cells_when_the_domain_moves_and_new_cells_start_from_zero() -> None:
    old = Domain.from_mask(np.ones((4, 4, 4), bool), (0, 0, 0))
    new = Domain.from_mask(np.ones((4, 4, 4), bool), (2, 0, -1))
    state = np.zeros((len(old) + 1, 3), dtype=np.float32)
    state[:-1] = old.cells + 10
    carried = old.carry(state, new)
    survives = ((new.cells >= 0) & (new.cells < 4)).all(axis=1)
    np.testing.assert_array_equal(carried[:-1][survives], new.cells[survives] + 10)
    assert not carried[:-1][~survives].any()
    assert not carried[-1].any()
    assert 0 < survives.sum() < len(new)


def test_cells_live_within_reach_of_smoke_and_inside_the_box() -> None:
    density = np.zeros((5, 5, 5), dtype=np.float32)
    density[0, 2, 2] = 1
    box = Box((10, 0, 0), (20, 5, 5))
    domain = Domain.around_smoke(density, (10, 0, 0), threshold=0.5, reach=2, box=box)
    assert len(domain) == 3 * 5 * 5
    assert domain.cells[:, 0].max() == 12


def test_a_box_can_live_as_a_whole_unless_it_is_absurdly_large() -> None:
    box = Box((3, -2, 0), (6, 2, 5))
    domain = Domain.filling(box)
    assert len(domain) == 3 * 4 * 5
    assert domain.scatter(np.ones(len(domain)), box).all()
    assert (domain.neighbours < len(domain)).all()
    with pytest.raises(OptionError, match=r"--domain box: .* 134742016 cells.*--domain active"):
        Domain.filling(Box((0, 0, 0), (512, 512, 514)))


def test_no_smoke_gives_no_cells() -> None:
    empty = np.zeros((0, 0, 0), dtype=np.float32)
    box = Box((0, 0, 0), (4, 4, 4))
    assert len(Domain.around_smoke(empty, (0, 0, 0), threshold=0.1, reach=2, box=box)) == 0


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.integers(0, 4))
def test_dilation_is_distance_along_the_axes(seed: int, reach: int) -> None:
    mask = np.random.default_rng(seed).random((6, 5, 7)) < 0.05
    grown = dilate(mask, reach)
    smoke = np.argwhere(mask)
    for cell in np.argwhere(np.ones_like(mask)):
        near = len(smoke) > 0 and np.abs(smoke - cell).max(axis=1).min() <= reach
        assert grown[tuple(cell)] == near


def test_cost_follows_the_smoke_however_far_a_sequence_reaches() -> None:
    box = Box((-(2**30),) * 3, (2**30,) * 3)  # as an array, more than any machine has
    domain = Domain.from_mask(np.ones((2, 2, 2), bool), (5, 5, 5), box=box)
    assert domain.neighbours.shape == (27, 8)
    assert np.count_nonzero(domain.neighbours < 8) == 8 * 8
    state = np.arange(9, dtype=np.float32)[:, None] + 1
    np.testing.assert_array_equal(domain.carry(state, domain), state)
