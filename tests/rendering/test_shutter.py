"""Motion blur is held to the mean of pictures taken while the shutter is open."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.rendering.test_film import PLACE, SHAPE, SIDES, camera_of, smoke

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Orthographic
from vnca.core.errors import OptionError, SequenceError, ShapeError
from vnca.core.volume import Volume
from vnca.engine.native.marching import smeared as natively_smeared
from vnca.recipe.film import FilmConfig, Shown, picture
from vnca.rendering.film import Picture, render
from vnca.rendering.shutter import STILL, blurred, screen_motion, smeared

ROWS, COLUMNS = 64, 96


def ways(seed: int, longest: float) -> FloatArray:
    random = np.random.default_rng(seed)
    way = random.uniform(-longest, longest, (ROWS, COLUMNS, 2)).astype(np.float32)
    way[random.uniform(size=way.shape[:2]) < 0.2] = 0
    return way


@pytest.mark.parametrize(("longest", "count"), [(0.02, 1), (0.4, 3), (9.0, 11), (900.0, 65)])
def test_the_native_core_smears_as_the_reference(longest: float, count: int) -> None:
    seen = np.random.default_rng(0).uniform(size=(ROWS, COLUMNS, 4)).astype(np.float32)
    way = ways(1, longest)
    found = natively_smeared(seen, way, count, STILL)
    np.testing.assert_allclose(found, smeared(seen, way, count, STILL), atol=2e-4)
    assert np.array_equal(found, seen) == (longest * np.sqrt(2) < STILL)


def test_what_is_even_stays_so_and_a_dot_becomes_a_line() -> None:
    even = np.full((ROWS, COLUMNS, 4), 0.3, np.float32)
    np.testing.assert_allclose(smeared(even, ways(2, 20.0), 9, STILL), even, rtol=1e-5)
    dot = np.zeros((ROWS, COLUMNS, 4), np.float32)
    dot[30, 40] = 1
    way = np.zeros((ROWS, COLUMNS, 2), np.float32)
    way[..., 1] = 10
    line = smeared(dot, way, 11, STILL)[..., 0]
    assert line.sum() == pytest.approx(1, abs=1e-5)
    assert not np.delete(line, 30, axis=0).any()
    columns = line[30].nonzero()[0]
    assert 34 <= columns.min() <= 36
    assert 44 <= columns.max() <= 46


def test_arrays_of_other_shapes_are_refused_and_so_are_endless_ways() -> None:
    seen = np.zeros((ROWS, COLUMNS, 4), np.float32)
    with pytest.raises(ShapeError, match="ways"):
        natively_smeared(seen, ways(0, 1.0)[1:].copy(), 3, STILL)
    with pytest.raises(ShapeError, match="finite"):
        natively_smeared(seen, np.full((ROWS, COLUMNS, 2), np.nan, np.float32), 3, STILL)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("place", [None, PLACE])
def test_cells_move_from_where_they_are_seen_to_where_they_are_seen_next(
    side: tuple[float, float, float | None], place: AnyArray | None
) -> None:
    camera, later = (camera_of(place, side[0] + turn, *side[1:]) for turn in (0.0, 5.0))
    velocity = np.random.default_rng(3).normal(size=(*SHAPE, 3)).astype(np.float32)
    density = np.ones(SHAPE, np.float32)
    moved = screen_motion(density, velocity, (camera, later), place)
    cell = np.array([7, 2, 5])
    matrix = np.eye(4) if place is None else place
    ends = []
    for seen_by, at in ((camera, cell), (later, cell + velocity[tuple(cell)])):
        row, column, _ = seen_by.project(matrix[:3, :3] @ at + matrix[:3, 3], 500, 700)
        ends.append(np.array([row, column]))
    np.testing.assert_allclose(
        500 * moved[tuple(cell)][1::-1], ends[1] - ends[0], rtol=1e-3, atol=0.01
    )
    assert not moved[..., 2].any()


def ball(at: float) -> tuple[FloatArray, FloatArray]:
    """A soft, bright ball, so far along x."""
    x, y, z = np.indices((24, 12, 16), dtype=np.float32)
    away = np.sqrt((x - at) ** 2 + (y - 6) ** 2 + (z - 8) ** 2)
    density = np.clip(4 - away, 0, 1).astype(np.float32)
    return density, np.full((*density.shape, 3), 0.8, np.float32)


def test_a_blurred_ball_is_the_mean_of_balls_on_their_way() -> None:
    camera = Orthographic((11.5, 5.5, 7.5), height=16.0)
    how: dict[str, Any] = {"gamma": 1.0, "step": 0.25}
    size = {"rows": ROWS, "columns": COLUMNS}

    def seen(at: float) -> Picture:
        return render(*ball(at), camera, **size, **how)

    density, _ = ball(10)
    velocity = np.zeros((*density.shape, 3), np.float32)
    velocity[..., 0] = 5
    found = blurred(seen(10), density, velocity, camera, camera, shutter=0.8, **how)
    times = np.linspace(-0.4, 0.4, 41)
    expected = np.mean([seen(10 + 5 * time).opacity for time in times], axis=0)
    sharp = np.abs(seen(10).opacity - expected).mean()
    assert np.abs(found.opacity - expected).mean() < 0.15 * sharp
    assert found.opacity.sum() == pytest.approx(expected.sum(), rel=0.01)
    assert found.opacity[:, 0].max() < 1e-3


def frame(velocity: FloatArray | None) -> Shown:
    density, colour = smoke(4)
    return Shown(Volume(density, velocity, (0, 0, 0), np.eye(4), 7), colour, 0.8)


BOUNDS = np.full(3, -0.5), np.array(SHAPE) - 0.5
SMALL: dict[str, Any] = {"rows": 24, "columns": 30}


def test_what_stands_still_is_as_without_a_shutter_and_the_longer_it_is_open_the_more_moves() -> (
    None
):
    moving = np.zeros((*SHAPE, 3), np.float32)
    moving[..., 2] = 2

    def seen(velocity: FloatArray | None, shutter: float, **how: Any) -> FloatArray:
        config = FilmConfig(**SMALL, shutter=shutter)
        return picture(frame(velocity), config, bounds=BOUNDS, turned=0.0, **how).rgba

    sharp = seen(None, 0.0)
    np.testing.assert_array_equal(seen(0 * moving, 0.7), sharp)
    np.testing.assert_array_equal(seen(None, 0.7, still=True), sharp)
    apart = [np.abs(seen(moving, shutter) - sharp).mean() for shutter in (0.0, 0.3, 1.0)]
    assert apart[0] == 0
    assert all(less < more for less, more in pairwise(apart))
    assert np.abs(seen(None, 1.0, still=True, turns=10.0) - sharp).mean() > 1e-3


def test_a_shutter_needs_a_velocity_and_closes_within_a_frame() -> None:
    config = FilmConfig(**SMALL, shutter=0.5)
    with pytest.raises(SequenceError, match=r"frame 7: no velocity, which `film\.shutter` needs"):
        picture(frame(None), config, bounds=BOUNDS, turned=0.0)
    for shutter in (-0.1, 1.1, float("nan")):
        with pytest.raises(OptionError, match=r"film\.shutter"):
            FilmConfig(shutter=shutter)
