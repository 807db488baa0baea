import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from vnca.core import AnyArray, BoolArray, Box, Index, IntArray
from vnca.core.errors import OptionError
from vnca.core.field import Field
from vnca.engine.automaton import OFFSETS
from vnca.engine.domain import Domain


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
    back = Field.from_dense(dense, domain.box.lower).gather(domain.cells)
    np.testing.assert_array_equal(back, values)
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


def test_cells_are_active_near_smoke_and_inside_the_box() -> None:
    density = np.zeros((5, 5, 5), dtype=np.float32)
    density[0, 2, 2] = 1
    box = Box((10, 0, 0), (20, 5, 5))
    smoke = Field.from_dense(density, (10, 0, 0))
    domain = Domain.around_smoke(smoke, threshold=0.5, dilation=2, box=box)
    assert len(domain) == 3 * 5 * 5
    assert domain.cells[:, 0].max() == 12


def test_a_box_can_live_as_a_whole_unless_it_is_absurdly_large() -> None:
    box = Box((3, -2, 0), (6, 2, 5))
    domain = Domain.filling(box)
    assert len(domain) == 3 * 4 * 5
    assert domain.scatter(np.ones(len(domain)), box).all()
    assert (domain.neighbours < len(domain)).all()
    with pytest.raises(OptionError, match=r"`domain` box: .* 134742016 cells.*`domain` active"):
        Domain.filling(Box((0, 0, 0), (512, 512, 514)))


def test_no_smoke_gives_no_cells() -> None:
    box = Box((0, 0, 0), (4, 4, 4))
    for size in (0, 4):
        empty = Field.from_dense(np.zeros((size,) * 3, dtype=np.float32), (0, 0, 0))
        domain = Domain.around_smoke(empty, threshold=0.1, dilation=2, box=box)
        assert domain.neighbours.shape == (27, 0)
        assert domain.carry(np.ones((1, 3), np.float32), domain).shape == (1, 3)


def listed(alive: BoolArray, origin: Index) -> IntArray:
    """Active cells of a dense array, brick by brick: what a domain must list."""
    cells = np.argwhere(alive) + origin
    return cells[np.lexsort((*cells.T[::-1], *(cells // 8).T[::-1]))].astype(np.int32)


def dense_neighbours(domain: Domain) -> IntArray:
    """Rows around each cell, through an array over all of the box: what a domain must find."""
    lower = np.asarray(domain.box.lower)
    row_of = np.full(domain.box.shape, len(domain), np.int32)
    row_of[tuple((domain.cells - lower).T)] = np.arange(len(domain))
    row_of = np.pad(row_of, 1, mode="edge" if domain.border == "replicate" else "wrap")
    at = (domain.cells - lower + 1)[None] + OFFSETS[:, None]
    return row_of[tuple(np.moveaxis(at, -1, 0))]


shapes = st.tuples(*[st.integers(1, 21)] * 3)
origins = st.tuples(*[st.integers(-20, 20)] * 3)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 1000), shapes, origins, st.floats(0, 1), st.sampled_from(["edge", "wrap"]))
def test_a_domain_of_bricks_is_that_of_a_dense_array(
    seed: int, shape: Index, origin: Index, share: float, border: str
) -> None:
    alive = np.random.default_rng(seed).random(shape) < share
    domain = Domain.from_mask(alive, origin, border="replicate" if border == "edge" else "circular")
    np.testing.assert_array_equal(domain.cells, listed(alive, origin))
    np.testing.assert_array_equal(domain.neighbours, dense_neighbours(domain))


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 1000), shapes, origins, st.integers(0, 10), st.integers(-4, 4))
def test_cells_around_smoke_are_those_a_dense_filter_finds(
    seed: int, shape: Index, origin: Index, dilation: int, margin: int
) -> None:
    density = np.random.default_rng(seed).random(shape).astype(np.float32) ** 64
    smoke = Field.from_dense(density, origin)
    box = smoke.box.grown(margin)
    domain = Domain.around_smoke(smoke, threshold=0.5, dilation=dilation, box=box)
    wide = np.pad(density > 0.5, dilation + 4)
    whole = smoke.box.grown(dilation + 4)
    in_box = np.zeros(wide.shape, bool)
    if not box.is_empty:
        in_box[box.intersection(whole).slices(whole)] = True
    wide = np.asarray(ndimage.maximum_filter(wide & in_box, 2 * dilation + 1)) & in_box
    np.testing.assert_array_equal(domain.cells, listed(wide, whole.lower))


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), shapes, shapes, origins)
def test_a_state_is_carried_by_index_coordinates(
    seed: int, shape: Index, other_shape: Index, origin: Index
) -> None:
    random = np.random.default_rng(seed)
    old = Domain.from_mask(random.random(shape) < 0.5, (0, 0, 0))
    new = Domain.from_mask(random.random(other_shape) < 0.5, origin)
    state = np.append(random.random((len(old), 2)), [[0, 0]], axis=0)
    by_cell = dict(zip(map(tuple, old.cells.tolist()), state.tolist(), strict=False))
    expected = [by_cell.get(tuple(cell), [0, 0]) for cell in new.cells.tolist()]
    np.testing.assert_array_equal(old.carry(state, new), [*expected, [0, 0]])
    # In whatever order the cells of a state are.
    order = random.permutation(len(old))
    shuffled = Domain(old.cells[order], old.box)
    carried = shuffled.carry(state[np.append(order, len(old))], new)
    np.testing.assert_array_equal(carried, [*expected, [0, 0]])


def two_blocks(apart: int) -> tuple[Domain, AnyArray]:
    """Two blocks of 12³ cells, and a state on them."""
    block = np.argwhere(np.ones((12, 12, 12), bool)).astype(np.int32)
    cells = np.concatenate([block, block + np.int32(apart)])
    corner = apart + 12
    domain = Domain(cells, Box((0, 0, 0), (corner, corner, corner)).grown(1))
    return domain, np.arange(len(cells) + 1, dtype=np.float32)[:, None]


def test_cost_follows_the_smoke_however_far_a_sequence_reaches() -> None:
    peaks = []
    for apart in (16, 2**30):  # as an array, more than any machine has
        domain, state = two_blocks(apart)
        tracemalloc.start()
        neighbours, carried = domain.neighbours, domain.carry(state, domain)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        np.testing.assert_array_equal(carried, state)
        assert np.count_nonzero(neighbours < len(domain)) == 2 * (12 + 11 + 11) ** 3
    assert peaks[1] < 1.1 * peaks[0]


def test_what_is_carried_by_whole_cells_arrives_as_it_was() -> None:
    old = Domain.from_mask(np.ones((5, 4, 6), bool), (0, 0, 0))
    new = Domain(old.cells + np.array([2, 0, 1], np.int32), old.box.grown(2))
    state = np.random.default_rng(0).random((len(old) + 1, 3)).astype(np.float32)
    old = Domain(old.cells, new.box)
    rows, shares = old.sources(new, np.broadcast_to(np.float32([2, 0, 1]), (len(new), 3)))
    np.testing.assert_array_equal((shares[..., None] * state[rows]).sum(0), state[:-1])


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.floats(-3, 3), st.sampled_from(["replicate", "circular"]))
def test_a_constant_state_stays_constant_wherever_it_is_carried(
    seed: int, speed: float, border: str
) -> None:
    domain = random_domain(seed, (6, 5, 7), border)
    moved = np.random.default_rng(seed).standard_normal((len(domain), 3)).astype(np.float32)
    rows, shares = domain.sources(domain, np.float32(speed) * moved)
    np.testing.assert_allclose(shares.sum(0), 1, rtol=1e-6)
    alive = np.append(np.ones(len(domain), np.float32), 0)
    np.testing.assert_allclose((shares * alive[rows]).sum(0), 1, rtol=1e-6)


def test_a_cell_with_nothing_upstream_keeps_its_own_state_and_a_new_one_has_none() -> None:
    old = Domain.from_mask(np.ones((4, 4, 4), bool), (0, 0, 0), box=Box((-9, -9, -9), (9, 9, 9)))
    new = Domain.from_mask(np.ones((4, 4, 5), bool), (0, 0, 0), box=old.box)
    rows, shares = old.sources(new, np.full((len(new), 3), [0, 0, 7], np.float32))
    state = np.append(np.arange(len(old)) + 1, 0)
    carried = (shares * state[rows]).sum(0)
    expected = old.carry(state, new)[:-1]
    np.testing.assert_array_equal(carried, expected)
    assert (expected == 0).sum() == 16
