from collections.abc import Sequence
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core import AnyArray, Box, Index
from vnca.core.errors import GridError
from vnca.core.field import Field
from vnca.core.lattice import (
    Beyond,
    Lattice,
    Placement,
    is_cubic,
    require_right_angles,
    upright_turn,
)

TURNS = [
    np.diag(signs)[list(order)]
    for order in permutations(range(3))
    for signs in product((1, -1), repeat=3)
]
turns = st.sampled_from(TURNS)
steps = st.tuples(*[st.integers(-200, 200)] * 3)
BOX = Box((-3, 2, 5), (4, 6, 14))


def matrix(linear: AnyArray, centre: Sequence[float] = (0, 0, 0)) -> AnyArray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = linear, centre
    return result


def rotation(degrees: float, axis: int = 2) -> AnyArray:
    """A right-handed turn about an axis."""
    angle = np.radians(degrees)
    flat = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    result = np.eye(3)
    others = [(axis + 1) % 3, (axis + 2) % 3]
    result[np.ix_(others, others)] = flat
    return result


def laid_on(
    place: Placement, values: AnyArray, box: Box, over: Box, beyond: Beyond = "nothing"
) -> AnyArray:
    """The array of a box of the one grid, over a box of the other."""
    return place.field(Field.from_dense(values, box.lower), over, beyond).dense()


def values(box: Box = BOX) -> AnyArray:
    return np.random.default_rng(0).random(box.shape, np.float32)


@given(turns, steps, st.sampled_from([0.1, 0.01875000074505806, 3.0]))
def test_grids_of_the_same_cells_have_one_lattice(turn: AnyArray, step: Index, size: float) -> None:
    cells = matrix(size * np.eye(3), (0.3 * size, 0.5 * size, -0.49 * size))
    named_otherwise = cells @ matrix(turn, step)
    lattice = Lattice.of(named_otherwise, "it")
    np.testing.assert_allclose(lattice.to_world, cells, atol=1e-12 * size * 200)
    assert lattice.spacing == pytest.approx(size)
    again = Lattice.of(lattice.to_world, "it")
    np.testing.assert_array_equal(again.to_world, lattice.to_world)


def test_a_grid_that_begins_at_the_origin_of_the_world_is_its_own_lattice() -> None:
    for centre in ((0, 0, 0), (0.05, 0.05, 0.05), (0.02, 0, -0.03)):
        cells = matrix(0.1 * np.eye(3), centre)
        np.testing.assert_array_equal(Lattice.of(cells, "it").to_world, cells)
        np.testing.assert_array_equal(Lattice.as_it_is(cells, "it").to_world, cells)


@given(turns, st.floats(-40, 40), st.integers(0, 2))
def test_a_turned_grid_keeps_its_turn_and_its_lattice_is_upright(
    turn: AnyArray, degrees: float, axis: int
) -> None:
    turned = 0.5 * rotation(degrees, axis)
    lattice = Lattice.of(matrix(turned @ turn), "it")
    np.testing.assert_allclose(lattice.to_world[:3, :3], turned, atol=1e-12)


def test_uneven_cells_are_divided_into_cubes() -> None:
    lattice = Lattice.of(matrix(rotation(20) @ np.diag([2, 0.5, 1])), "it")
    np.testing.assert_allclose(lattice.to_world[:3, :3], 0.5 * rotation(20))
    assert is_cubic(lattice.to_world)
    with pytest.raises(GridError, match=r"^it: expected cubic cells, got sides of 2, 0\.5, 1"):
        Lattice.as_it_is(matrix(np.diag([2, 0.5, 1])), "it")


@pytest.mark.parametrize("make", [Lattice.of, Lattice.as_it_is, require_right_angles])
def test_sheared_cells_are_refused(make) -> None:  # type: ignore[no-untyped-def]
    sheared = matrix(np.array([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]))
    with pytest.raises(GridError, match=r"^it: its voxels are sheared .* 84, 90, 90 degrees"):
        make(sheared, "it")


def test_cells_too_far_from_the_origin_to_be_counted_from_there_keep_their_numbers() -> None:
    far = matrix(np.eye(3), (1e13, 0, 0))
    np.testing.assert_array_equal(Lattice.of(far, "it").to_world, far)


@given(turns, steps)
def test_cells_that_lie_on_cells_arrive_unchanged_and_come_back(
    turn: AnyArray, step: Index
) -> None:
    source = matrix(0.1 * np.eye(3))
    place = Placement.between(source @ matrix(turn, step), source, BOX, "it")
    assert place.is_whole
    there = values()
    over = place.box(BOX)
    moved = laid_on(place, there, BOX, over)
    assert moved.flags.c_contiguous
    # Cell by cell, by the definition of a transform.
    for cell in ((-3, 2, 5), (3, 5, 13), (0, 4, 6)):
        x, y, z = (turn @ cell + step - over.lower).tolist()
        assert moved[x, y, z] == there[tuple(np.subtract(cell, BOX.lower))]
    back = place.inverse
    assert back.box(over) == BOX
    np.testing.assert_array_equal(laid_on(back, moved, over, BOX), there)
    arrows = np.random.default_rng(1).standard_normal((5, 3)).astype(np.float32)
    np.testing.assert_array_equal(place.vectors(arrows), arrows @ turn.T.astype(np.float32))
    cells = np.array([[0, 1, 2], [-5, 3, 8]])
    np.testing.assert_array_equal(place.cells(cells), cells @ turn.T + step)


def test_a_larger_box_is_filled_up_with_nothing_and_a_smaller_one_cuts() -> None:
    place = Placement.between(np.eye(4), np.eye(4), BOX, "it")
    np.testing.assert_array_equal(laid_on(place, values(), BOX, BOX.grown(2)), np.pad(values(), 2))
    np.testing.assert_array_equal(
        laid_on(place, values(), BOX, BOX.grown(-1)), values()[1:-1, 1:-1, 1:-1]
    )
    assert not laid_on(place, values(), BOX, Box((50, 0, 0), (52, 2, 2))).any()


@pytest.mark.parametrize("noise", [1e-7, 2e-4])
def test_rounding_in_a_file_does_not_move_cells(noise: float) -> None:
    source = matrix((1 + noise) * np.eye(3), (noise, 3, 0))
    place = Placement.between(source, np.eye(4), BOX, "it")
    assert place.is_whole
    assert place.box(BOX) == Box((-3, 5, 5), (4, 9, 14))


@pytest.mark.parametrize(
    "source",
    [
        matrix(np.eye(3), (0.5, 0, 0)),
        matrix(np.diag([1, 1, 1.01])),
        matrix(rotation(1)),
        matrix(2 * np.eye(3)),
        matrix(np.diag([1, 4, 1])),
    ],
)
def test_other_cells_are_interpolated_as_linear_fields_are(source: AnyArray) -> None:
    """Whatever is linear in the world is kept, between cells that all have a value."""
    place = Placement.between(source, np.eye(4), BOX, "it")
    assert not place.is_whole

    def rising(cells: AnyArray, to_world: AnyArray) -> AnyArray:
        return (cells @ to_world[:3, :3].T + to_world[:3, 3]) @ (3, -2, 1) + 40

    def all_of(box: Box) -> AnyArray:
        return np.moveaxis(np.indices(box.shape), 0, -1) + box.lower

    field = rising(all_of(BOX), source).astype(np.float32)
    over = place.box(BOX)
    moved = laid_on(place, field, BOX, over)
    known = laid_on(place, np.ones_like(field), BOX, over)
    inside = known > 1 - 1e-6
    assert inside.sum() > 30
    np.testing.assert_allclose(moved[inside], rising(all_of(over), np.eye(4))[inside], rtol=1e-4)
    # Nothing is left out at the ends, and nothing is there farther out.
    beyond = over.grown(1)
    padded = laid_on(place, field, BOX, beyond)
    np.testing.assert_array_equal(padded[1:-1, 1:-1, 1:-1], moved)
    assert padded.sum(dtype=float) == pytest.approx(moved.sum(dtype=float))


def test_smoke_keeps_its_mass_whatever_cells_it_is_laid_on() -> None:
    wide = np.zeros((9, 9, 9), np.float32)
    wide[2:7, 2:7, 2:7] = np.random.default_rng(0).random((5, 5, 5))
    box = Box((0, 0, 0), (9, 9, 9))
    for size in (0.4, 1 / 3, 1.0, 2.0, 2.5):
        place = Placement.between(
            matrix(np.eye(3), (0.3, 0.2, 0.6)), matrix(size * np.eye(3)), box, "it"
        )
        laid = laid_on(place, wide, box, place.box(box))
        assert laid.sum() * size**3 == pytest.approx(wide.sum(), rel=0.03)


def test_a_larger_cell_has_the_mean_of_the_smaller_ones_in_it() -> None:
    box = Box((0, 0, 0), (8, 4, 4))
    fine = values(box)
    place = Placement.between(np.eye(4), matrix(np.diag([4, 1, 1]), (1.5, 0, 0)), box, "it")
    coarse = laid_on(place, fine, box, Box((0, 0, 0), (2, 4, 4)))
    np.testing.assert_allclose(coarse, fine.reshape(2, 4, 4, 4).mean(axis=1), rtol=1e-6)


def test_what_is_beyond_the_array_is_nothing_or_its_nearest_cell() -> None:
    box = Box((0, 0, 0), (2, 2, 2))
    place = Placement.between(matrix(np.eye(3), (0.5, 0, 0)), np.eye(4), box, "it")
    over = Box((-2, 0, 0), (5, 2, 2))
    ones = np.ones(box.shape, np.float32)
    np.testing.assert_allclose(laid_on(place, ones, box, over)[:, 0, 0], [0, 0, 0.5, 1, 0.5, 0, 0])
    assert (laid_on(place, ones, box, over, "nearest") == 1).all()


def test_vectors_are_turned_and_scaled_with_their_cells() -> None:
    place = Placement.between(matrix(0.5 * rotation(90)), matrix(0.25 * rotation(0)), BOX, "it")
    np.testing.assert_allclose(
        place.vectors(np.array([[1, 2, 3]], np.float32)), [[-4, 2, 6]], atol=1e-6
    )


def test_nothing_stays_nothing() -> None:
    nowhere = Box((0, 0, 0), (0, 0, 0))
    nothing = np.zeros((0, 3, 0), np.float32)
    for source in (np.eye(4), matrix(np.eye(3), (0.5, 0, 0)), matrix(-np.eye(3))):
        place = Placement.between(source, np.eye(4), nowhere, "it")
        assert place.box(nowhere).is_empty
        assert laid_on(place, nothing, nowhere, nowhere).shape == (0, 0, 0)
        assert not laid_on(place, nothing, nowhere, BOX).any()


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_upright_turn_is_right_handed_and_the_nearest(seed: int) -> None:
    linear = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    turn = upright_turn(matrix(linear))[:3, :3]
    assert np.linalg.det(linear @ turn) == pytest.approx(1)
    nearness = [np.trace(linear @ other) for other in TURNS if np.linalg.det(linear @ other) > 0]
    assert np.trace(linear @ turn) > max(nearness) - 0.03
