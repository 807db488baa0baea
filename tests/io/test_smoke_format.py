"""Which way up smoke is, and which way round; `tests/core/test_lattice.py` has the arithmetic."""

from dataclasses import replace

import numpy as np
import pytest

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import GridError
from vnca.core.lattice import MOST_CELLS, Lattice
from vnca.core.volume import Volume
from vnca.io.smoke_format import on_lattice, on_one_lattice, own_cells, upright_world

MOVED = np.array([[0, 0, 0.5, 3], [0.5, 0, 0, -2], [0, -0.5, 0, 7], [0, 0, 0, 1.0]])


def test_what_is_up_in_a_file_is_up_inside() -> None:
    assert (upright_world(np.eye(4), "y") @ (1, 2, 3, 1)).tolist() == [3, 1, 2, 1]
    assert (upright_world(np.eye(4), "z") @ (1, 2, 3, 1)).tolist() == [1, 2, 3, 1]
    assert np.linalg.det(upright_world(np.eye(4), "y")) == 1


def test_cells_are_counted_along_the_axes_of_the_world_and_stay_where_they_are() -> None:
    place, matrix = own_cells(MOVED, "it")
    assert place.is_whole
    np.testing.assert_array_equal(matrix[:3, :3], np.diag([0.5] * 3))
    cell = np.array([[4, -1, 2]])
    (inside,) = place.cells(cell)
    np.testing.assert_array_equal(matrix @ (*inside, 1), MOVED @ (*cell[0], 1))


def cloud(index_to_world: AnyArray, **changes: object) -> Volume:
    random = np.random.default_rng(2)
    density = random.random((4, 5, 6), np.float32)
    velocity = random.standard_normal((4, 5, 6, 3)).astype(np.float32)
    return replace(Volume(density, velocity, (3, -2, 9), index_to_world, 7), **changes)  # type: ignore[arg-type]


def seen(smoke: Volume) -> dict[tuple[int, ...], FloatArray]:
    """Density, and velocity as lengths of the world, by place in it, in thousandths."""
    assert smoke.velocity is not None
    cells = np.moveaxis(np.indices(smoke.density.shape), 0, -1).reshape(-1, 3) + smoke.origin
    linear, centre = smoke.index_to_world[:3, :3], smoke.index_to_world[:3, 3]
    places = np.rint(1000 * (cells @ linear.T + centre)).astype(int)
    values = np.c_[smoke.density.reshape(-1), smoke.velocity.reshape(-1, 3) @ linear.T]
    return {tuple(place): value for place, value in zip(places.tolist(), values, strict=True)}


def test_a_frame_laid_on_a_lattice_is_the_same_smoke_in_the_same_place() -> None:
    smoke = cloud(MOVED)
    laid = on_lattice(smoke, Lattice.of(MOVED, "it"), "it")
    before, after = seen(smoke), seen(laid)
    assert before.keys() == after.keys()
    for place, values in before.items():
        np.testing.assert_allclose(after[place], values, rtol=1e-6)
    assert sorted(laid.density.shape) == [4, 5, 6]
    assert laid.frame == 7


def test_a_frame_that_lies_on_its_lattice_is_not_touched() -> None:
    smoke = cloud(np.diag([0.25, 0.25, 0.25, 1.0]))
    laid = on_lattice(smoke, Lattice.of(smoke.index_to_world, "it"), "it")
    assert laid.origin == smoke.origin
    for was, now in ((smoke.density, laid.density), (smoke.velocity, laid.velocity)):
        assert was is not None
        assert now is not None
        np.testing.assert_array_equal(now, was)
    assert np.shares_memory(laid.density_field.values, smoke.density_field.values)


def test_interpolated_velocity_does_not_slow_down_at_the_border() -> None:
    wind = np.broadcast_to(np.float32([1, 2, 3]), (4, 5, 6, 3)).copy()
    smoke = cloud(np.diag([0.5, 0.5, 0.5, 1.0]), velocity=wind)
    finer = Lattice(np.diag([0.2, 0.2, 0.2, 1.0]))
    laid = on_lattice(smoke, finer, "it")
    assert laid.velocity is not None
    np.testing.assert_allclose(laid.velocity[laid.density > 0] - (2.5, 5, 7.5), 0, atol=1e-5)


def test_frames_of_one_painting_lie_on_the_lattice_of_the_first_with_smoke() -> None:
    cubes = np.diag([0.5, 0.5, 0.5, 1.0])
    moved = cubes.copy()
    moved[:3, 3] = 1, 0, -0.5
    nothing = Volume(np.zeros((0, 0, 0), np.float32), None, (0, 0, 0), np.diag([9, 9, 9, 1.0]), 1)
    empty, first, second, last = on_one_lattice([nothing, cloud(moved), cloud(cubes), nothing])
    assert empty is nothing
    assert (first.origin, second.origin) == ((3, -2, 9), (1, -2, 10))
    for smoke in (first, second, last):
        np.testing.assert_array_equal(smoke.index_to_world, moved)


@pytest.mark.parametrize(
    ("index_to_world", "words"),
    [
        (
            np.array([[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
            r"^frame 7: its voxels are sheared \(their sides meet at 63, 90, 90 degrees\); resam",
        ),
        (np.diag([1, 1, 2, 1.0]), r"^frame 7: expected cubic cells, got sides of 1, 1, 2; lay it"),
    ],
)
def test_cells_that_cannot_be_painted_on_are_refused(index_to_world: AnyArray, words: str) -> None:
    with pytest.raises(GridError, match=words) as caught:
        list(on_one_lattice([cloud(index_to_world)]))
    assert "\n" not in str(caught.value)


def test_a_later_frame_that_is_sheared_or_much_too_large_is_refused() -> None:
    sheared = np.array([[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    with pytest.raises(GridError, match="frame 8: its voxels are sheared"):
        list(on_one_lattice([cloud(np.eye(4)), cloud(sheared, frame=8)]))
    vast = np.diag([500, 500, 500, 1.0])
    with pytest.raises(GridError, match=rf"frame 8: takes more than {MOST_CELLS} cubic cells"):
        list(on_one_lattice([cloud(np.eye(4)), cloud(vast, frame=8)]))
    far = np.eye(4)
    far[0, 3] = 1e12
    with pytest.raises(GridError, match="frame 8: its cells lie too far"):
        list(on_one_lattice([cloud(np.eye(4)), cloud(far, frame=8)]))
