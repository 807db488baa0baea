import numpy as np
import pytest

from vnca.core.errors import OptionError
from vnca.simulation import Smoke, project
from vnca.simulation.pressure import ALL_OPEN, CEILING, Open, Pressure

SHAPE = (12, 10, 14)
WALLS: Open = ((False, False), (False, False), (False, False))
MIXED: Open = ((True, True), (False, True), (False, False))


def stirred(opened: Open, solid: np.ndarray | None = None) -> Smoke:
    random = np.random.default_rng(0)
    smoke = Smoke.at_rest(SHAPE, opened, solid)
    smoke.faces = [random.standard_normal(face.shape, np.float32) for face in smoke.faces]
    return smoke


def block() -> np.ndarray:
    solid = np.zeros(SHAPE, bool)
    solid[4:8, 3:7, 5:9] = True
    return solid


@pytest.mark.parametrize("opened", [WALLS, CEILING, MIXED, ALL_OPEN])
def test_projected_air_neither_swells_nor_shrinks(opened: Open) -> None:
    smoke = stirred(opened)
    project(smoke)
    assert np.abs(smoke.divergence).max() < 2e-5
    for axis, sides in enumerate(opened):
        for end, is_open in zip((0, -1), sides, strict=True):
            assert smoke.faces[axis].take(end, axis).any() == is_open


@pytest.mark.parametrize("opened", [WALLS, CEILING, ALL_OPEN])
def test_air_flows_around_an_obstacle_and_not_through_it(opened: Open) -> None:
    solid = block()
    smoke = stirred(opened, solid)
    before = smoke.divergence[~solid]
    project(smoke)
    assert np.abs(smoke.divergence[~solid]).max() < 5e-3 * np.abs(before).max()
    x, y, z = smoke.faces
    assert not x[4:9, 3:7, 5:9].any()
    assert not y[4:8, 3:8, 5:9].any()
    assert not z[4:8, 3:7, 5:10].any()
    assert x[3].any()


def test_an_obstacle_of_no_cells_is_none() -> None:
    plain, with_none = stirred(CEILING), stirred(CEILING, np.zeros(SHAPE, bool))
    for smoke in (plain, with_none):
        project(smoke)
    for one, other in zip(plain.faces, with_none.faces, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-3)


def test_air_at_rest_stays_at_rest() -> None:
    smoke = Smoke.at_rest(SHAPE, ALL_OPEN, block())
    project(smoke)
    assert not any(face.any() for face in smoke.faces)


def test_a_lower_side_alone_cannot_be_open() -> None:
    with pytest.raises(OptionError, match="opened"):
        Pressure(((True, False), (False, False), (False, False)))
