import numpy as np
import pytest

from vnca.core.errors import OptionError
from vnca.simulation import simulate
from vnca.simulation.obstacles import solid_of
from vnca.simulation.scenes import Stage

CORNERS = np.array([[x, y, z] for x in (0, 2) for y in (0, 1) for z in (0, 1)], float)
CUBOID = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def stage(resolution: int = 32) -> Stage:
    return Stage((1, 1, 1.5), resolution, 0)


def test_a_cuboid_fills_its_cells_in_the_middle_above_the_floor() -> None:
    solid = solid_of(CORNERS, CUBOID, stage())
    at = np.argwhere(solid)
    extent = at.max(0) - at.min(0) + 1
    # Half a width long: 16 cells, and half of that across and high.
    np.testing.assert_allclose(extent, [16, 8, 8], atol=1)
    assert solid.sum() == extent.prod()
    np.testing.assert_allclose(at[:, :2].mean(0), [15.5, 15.5], atol=0.51)
    assert at[:, 2].min() == pytest.approx(0.1 * 32, abs=1)


def test_the_size_of_the_file_does_not_matter() -> None:
    larger = solid_of(CORNERS * 1000 + 7, CUBOID, stage())
    np.testing.assert_array_equal(larger, solid_of(CORNERS, CUBOID, stage()))


def test_smoke_goes_around_a_mesh() -> None:
    (*_, last) = simulate("bunny", resolution=16, frames=24, seed=0, mesh=(CORNERS, CUBOID))
    solid = solid_of(CORNERS, CUBOID, stage(16))
    assert not last.density[solid].any()
    assert last.density.sum() > 20
    assert last.density[:, :, 5:].any()


@pytest.mark.parametrize(
    ("vertices", "words"),
    [(np.zeros((8, 3)), "no extent"), (CORNERS * [1, 1, 0], "encloses no cell")],
)
def test_what_is_no_solid_is_refused(vertices: np.ndarray, words: str) -> None:
    with pytest.raises(OptionError, match=words):
        solid_of(vertices, CUBOID, stage())


def test_a_mesh_is_wanted_by_the_scene_that_needs_one_and_by_no_other() -> None:
    with pytest.raises(OptionError, match="`mesh`: the scene bunny needs one"):
        simulate("bunny", resolution=16, frames=1, seed=0)
    with pytest.raises(OptionError, match="`mesh`: the scene plume has no place"):
        simulate("plume", resolution=16, frames=1, seed=0, mesh=(CORNERS, CUBOID))
