"""Grids to and from dense arrays."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core import Box
from vnca.core.errors import GridError
from vnca.io.vdb import Grid, Transform

UNIT = Transform.uniform(1.0)
corners = st.tuples(*[st.integers(-40, 40)] * 3)
shapes = st.tuples(*[st.integers(1, 19)] * 3)


def from_dense(values: np.ndarray, active: np.ndarray, origin=(0, 0, 0), **options) -> Grid:
    return Grid.from_dense("g", values, active, origin, transform=UNIT, **options)


@settings(deadline=None, max_examples=60)
@given(corners, shapes, corners, shapes, st.integers(0, 2**32 - 1))
def test_any_box_of_a_grid_holds_the_cells_that_went_in(origin, shape, low, size, seed) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=shape).astype(np.float32)
    active = rng.random(shape) < 0.2
    box = Box(low, tuple(np.add(low, size).tolist()))
    got, got_active = from_dense(values, active, origin, background=7).to_dense(box)
    for cell in np.ndindex(*size):
        place = tuple(np.add(low, cell) - origin)
        inside = all(0 <= p < n for p, n in zip(place, shape, strict=True))
        is_active = inside and bool(active[place])
        assert got_active[cell] == is_active
        assert got[cell] == (values[place] if is_active else 7)


@settings(deadline=None, max_examples=60)
@given(corners, shapes, st.integers(0, 2**32 - 1))
def test_the_active_box_is_the_tightest(origin, shape, seed) -> None:
    active = np.random.default_rng(seed).random(shape) < 0.02
    box = from_dense(np.ones(shape, np.float32), active, origin).active_box()
    if not active.any():
        assert box.is_empty
    else:
        cells = np.argwhere(active) + origin
        assert box == (tuple(cells.min(0)), tuple(cells.max(0) + 1))


def test_tiles_count_in_boxes_voxels_and_arrays(tiled_grid: Callable[..., Grid]) -> None:
    grid = tiled_grid(background=1)
    leaves = int(grid.tree.leaf_active.sum())
    assert grid.active_voxels == leaves + 4096**3 + 128**3 + 8**3
    assert grid.active_box() == ((-5, 0, -3), (8192 + 4096, 4096, 4096))
    values, active = grid.to_dense(Box((62, -1, 0), (75, 1, 9)))
    expected = np.full((13, 2, 9), 1, np.float32)
    expected[:, 0] = 12  # the inactive one at (0, -4096, 0)
    expected[2:10, 1, :8] = 15  # the active one at (64, 0, 0)
    expected[10:, 1, 8] = 16  # the inactive one at (72, 0, 8)
    np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(active, expected == 15)


def test_fill_marks_every_inactive_cell_and_only_those() -> None:
    values = np.full((3, 3, 3), 5, np.float32)
    active = np.zeros((3, 3, 3), bool)
    active[1, 1, 1] = True
    got, _ = from_dense(values, active).to_dense(Box((0, 0, 0), (10, 3, 3)), fill=np.nan)
    assert got[1, 1, 1] == 5
    assert np.isnan(got).sum() == got.size - 1


def test_not_a_number_travels_as_any_value() -> None:
    values = np.full((2, 2, 2), np.nan, np.float32)
    grid = from_dense(values, np.ones((2, 2, 2), bool))
    assert np.isnan(grid.to_dense(Box((0, 0, 0), (2, 2, 2)))[0]).all()


def test_an_empty_grid_has_an_empty_box_and_dense_background() -> None:
    grid = from_dense(np.ones((4, 4, 4), np.float32), np.zeros((4, 4, 4), bool), background=3)
    assert grid.active_box().is_empty
    assert grid.active_voxels == 0
    values, active = grid.to_dense(Box((0, 0, 0), (9, 1, 1)))
    assert (values == 3).all()
    assert not active.any()
    assert grid.to_dense(Box((5, 5, 5), (5, 6, 6)))[0].shape == (0, 1, 1)


def test_a_grid_like_another_takes_its_place_in_the_world(
    random_grid: Callable[..., Grid],
) -> None:
    model = random_grid("float", half=True)
    model.metadata.update(type(model.metadata).of({"note": "kept", "file_delayed_load": "stale"}))
    grid = Grid.from_dense(
        "Cd", np.ones((2, 2, 2, 3), np.float32), np.ones((2, 2, 2), bool), (0, 0, 0),
        like=model, grid_class="unknown", metadata={"vector_type": "invariant"},
    )  # fmt: skip
    assert (grid.transform, grid.is_half, grid.value_type) == (model.transform, True, "vec3s")
    assert {name: entry.value for name, entry in grid.metadata.items()} == {
        "note": "kept", "class": "unknown", "vector_type": "invariant",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("values", "active", "options", "words"),
    [
        (np.ones((2, 2, 2), np.float32), np.ones((2, 2, 3), bool), {}, "boolean mask"),
        (np.ones((2, 2, 2), np.float32), np.ones((2, 2, 2)), {}, "boolean mask"),
        (np.ones((2, 2, 2), np.uint8), np.ones((2, 2, 2), bool), {}, "no grid type for uint8"),
        (np.ones((2, 2, 2, 2), "f4"), np.ones((2, 2, 2), bool), {}, "no grid type"),
        (np.ones((2, 2, 2), "f4"), np.ones((2, 2, 2), bool), {"origin": (2**31, 0, 0)}, "32-bit"),
    ],
)
def test_arrays_that_make_no_grid_are_refused(values, active, options, words) -> None:
    with pytest.raises(GridError, match=words):
        from_dense(values, active, **options)


def test_a_grid_needs_a_place_in_the_world() -> None:
    with pytest.raises(GridError, match="needs a transform"):
        Grid.from_dense("g", np.ones((2, 2, 2), "f4"), np.ones((2, 2, 2), bool), (0, 0, 0))


def test_a_box_beyond_all_memory_is_refused_before_it_is_made() -> None:
    grid = from_dense(np.ones((2, 2, 2), np.float32), np.ones((2, 2, 2), bool))
    with pytest.raises(GridError, match="too large"):
        grid.to_dense(Box((0, 0, 0), (10**6, 10**6, 10**6)))
