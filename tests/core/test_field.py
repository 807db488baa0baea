"""Fields of bricks against the dense arrays they stand for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from vnca.core import AnyArray, Box, Index
from vnca.core.bricks import Places, bricks_beside, cells_at, sorted_bricks
from vnca.core.errors import GridError
from vnca.core.field import Field, dilated, refined

seeds = st.integers(0, 2**32 - 1)
shapes = st.tuples(*[st.integers(1, 19)] * 3)
origins = st.tuples(*[st.integers(-30, 30)] * 3)
few = settings(deadline=None, max_examples=30)


def sparse(seed: int, shape: tuple[int, ...]) -> AnyArray:
    """Mostly 0.5."""
    random = np.random.default_rng(seed)
    values = np.full(shape, 0.5, np.float32)
    some = random.random(shape[:3]) < 10 / np.prod(shape[:3])
    values[some] = random.random((*shape[3:],))
    return values


@few
@given(seeds, shapes, origins, st.sampled_from([(), (3,)]))
def test_a_field_is_the_array_it_was_made_from(
    seed: int, shape: Index, origin: Index, components: tuple[int, ...]
) -> None:
    values = sparse(seed, (*shape, *components))
    field = Field.from_dense(values, origin, outside=0.5)
    assert field.shape == values.shape
    np.testing.assert_array_equal(field.dense(), values)
    wider = field.box.grown(9)
    np.testing.assert_array_equal(
        field.dense(wider), np.pad(values, [(9, 9)] * 3 + [(0, 0)] * len(components),
                                   constant_values=0.5)
    )  # fmt: skip
    cells = np.argwhere(np.ones(wider.shape, bool)).astype(np.int32)
    cells = np.random.default_rng(seed).permutation(cells) + np.array(wider.lower, np.int32)
    at = tuple((cells - wider.lower).T)
    np.testing.assert_array_equal(field.gather(cells), field.dense(wider)[at])


@few
@given(seeds, shapes, origins)
def test_a_field_of_listed_cells_holds_them_and_nothing_else(
    seed: int, shape: Index, origin: Index
) -> None:
    values = sparse(seed, shape)
    where = values != 0.5
    cells = (np.argwhere(where) + origin).astype(np.int32)
    box = Field.from_dense(values, origin).box
    field = Field.from_cells(cells, values[where], box, outside=0.5)
    np.testing.assert_array_equal(field.dense(), values)
    listed = cells_at(field.bricks, field.values != 0.5)
    assert {*map(tuple, listed.tolist())} == {*map(tuple, cells.tolist())}


@few
@given(seeds, shapes, origins, st.tuples(*[st.integers(-12, 12)] * 6))
def test_a_part_of_a_field_is_that_part_of_the_array(
    seed: int, shape: Index, origin: Index, ends: tuple[int, ...]
) -> None:
    field = Field.from_dense(sparse(seed, shape), origin, outside=0.5)
    (a, b, c), (x, y, z) = field.box
    box = Box((a + ends[0], b + ends[1], c + ends[2]), (x + ends[3], y + ends[4], z + ends[5]))
    part = field.within(box)
    assert part.box.shape == field.box.intersection(box).shape
    expected = np.full(field.shape, 0.5)
    if not part.box.is_empty:
        inside = part.box.slices(field.box)
        expected[inside] = field.dense()[inside]
    np.testing.assert_array_equal(part.dense(field.box), expected)
    np.testing.assert_array_equal(part.trimmed().dense(field.box), expected)


@few
@given(seeds, shapes, origins, st.integers(0, 2), st.sampled_from([-1, 1]))
def test_neighbours_are_found_in_the_brick_beside(
    seed: int, shape: Index, origin: Index, axis: int, step: int
) -> None:
    field = Field.from_dense(sparse(seed, shape), origin, outside=0.5)
    cells = cells_at(field.bricks, np.ones(field.values.shape, bool))
    beside = field.gather(cells + step * np.eye(3, dtype=np.int32)[axis])
    np.testing.assert_array_equal(field.shifted(axis, step).reshape(-1), beside)
    around = field.haloed()
    for offset in ((-1, -1, -1), (0, 1, -1), (1, 0, 0), (0, 0, 0)):
        inner = tuple(slice(1 + o, 9 + o) for o in offset)
        expected = field.gather(cells + np.array(offset, np.int32))
        np.testing.assert_array_equal(around[(slice(None), *inner)].reshape(-1), expected)


@few
@given(seeds, shapes, origins, st.integers(0, 11))
def test_marks_grow_as_in_a_dense_array(seed: int, shape: Index, origin: Index, reach: int) -> None:
    marked = sparse(seed, shape) != 0.5
    grown = dilated(Field.from_dense(marked, origin), reach)
    np.testing.assert_array_equal(grown.dense(), ndimage.maximum_filter(marked, 2 * reach + 1))


@few
@given(
    seeds,
    shapes,
    origins,
    st.permutations(range(3)),
    st.tuples(*[st.sampled_from([1, -1])] * 3),
)
def test_axes_are_exchanged_and_mirrored(
    seed: int, shape: Index, origin: Index, order: list[int], signs: Index
) -> None:
    values = sparse(seed, (*shape, 2))
    field = Field.from_dense(values, origin, outside=0.5)
    turned = field.turned(order, signs)
    flipped = values.transpose(*order, 3)[tuple(slice(None, None, sign) for sign in signs)]
    np.testing.assert_array_equal(turned.dense(), flipped)
    assert (turned.bricks == sorted_bricks(turned.bricks)).all()
    for axis, (source, sign) in enumerate(zip(order, signs, strict=True)):
        ends = origin[source], origin[source] + shape[source]
        assert (turned.box.lower[axis], turned.box.upper[axis]) == (
            ends if sign > 0 else (-ends[1], -ends[0])
        )


@few
@given(seeds, shapes, origins, st.tuples(*[st.integers(-20, 20)] * 3))
def test_cells_are_moved(seed: int, shape: Index, origin: Index, by: Index) -> None:
    values = sparse(seed, shape)
    moved = Field.from_dense(values, origin, outside=0.5).moved(by)
    assert moved.origin == tuple(np.add(origin, by))
    np.testing.assert_array_equal(moved.dense(), values)
    assert (moved.bricks == sorted_bricks(moved.bricks)).all()


def dense_refined(values: AnyArray, factor: int) -> AnyArray:
    """Linear between centres along one axis after the other, the outermost going on."""
    for axis, cells in enumerate(values.shape[:3]):
        at = np.clip((np.arange(factor * cells) + 0.5) / factor - 0.5, 0, cells - 1)
        below = at.astype(int)
        weight = (at - below).astype(np.float32).reshape(-1, *[1] * (values.ndim - axis - 1))
        low = values.take(below, axis)
        values = low + (values.take(np.minimum(below + 1, cells - 1), axis) - low) * weight
    return values


@few
@given(seeds, st.tuples(*[st.integers(1, 11)] * 3), origins, st.integers(2, 5))
def test_finer_fields_are_finer_arrays_to_the_bit(
    seed: int, shape: Index, origin: Index, factor: int
) -> None:
    values = sparse(seed, (*shape, 2)) - np.float32(0.5)
    finer = refined(Field.from_dense(values, origin), factor)
    np.testing.assert_array_equal(finer.dense(), dense_refined(values, factor))
    assert (finer.bricks == sorted_bricks(finer.bricks)).all()


def test_bricks_are_found_at_the_ends_of_the_index_range() -> None:
    ends = (-(2**28), -1, 0, 2**28 - 1)
    bricks = sorted_bricks(np.array(np.meshgrid(ends, ends, ends)).reshape(3, -1).T)
    assert (Places(bricks).find(bricks) == np.arange(64)).all()
    assert (Places(bricks).find(bricks + np.array([0, 0, 7])) == 64).all()
    assert (Places(bricks[:0]).find(bricks) == 0).all()
    assert len(bricks_beside(bricks[:1], 2)) == 125


def test_an_array_of_far_more_cells_than_there_are_is_one_clear_line() -> None:
    cells = np.array([[0, 0, 0], [2000, 2000, 2000]], np.int32)
    field = Field.from_cells(cells, np.ones(2, np.float32), Box((0, 0, 0), (2001, 2001, 2001)))
    assert field.values.nbytes == 2 * 2048
    with pytest.raises(GridError, match=r"cells \(0, 0, 0\) to \(2001, 2001, 2001\), too many"):
        field.dense()
    assert field.dense(Box((1999, 1999, 1999), (2001, 2001, 2001))).sum() == 1
