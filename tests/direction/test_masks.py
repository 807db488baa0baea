"""Where values hold: shapes, pictures, meshes, grids, and what goes along with the smoke."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core import Box
from vnca.core.camera import frame_box
from vnca.core.errors import GridError, SequenceError
from vnca.core.field import Field
from vnca.core.volume import Volume
from vnca.direction import Inputs, Moment
from vnca.direction.carried import Carried, carry
from vnca.direction.distance import distances
from vnca.direction.grammar import parsed
from vnca.io import read_smoke
from vnca.io.picture import write_image
from vnca.io.sequence import find_frames

SIZE = 9
PLACES = np.stack(np.meshgrid(*[np.arange(SIZE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
CELLS = PLACES.astype(np.int32)
WORLD = 0.5 * PLACES


def moment(frame: int = 1, density: Any = None, velocity: Any = None, **inputs: Any) -> Moment:
    density = np.ones((SIZE, SIZE, SIZE), np.float32) if density is None else density
    smoke = Volume(density, velocity, (0, 0, 0), np.diag([0.5, 0.5, 0.5, 1.0]), frame)
    return Moment(smoke, smoke.box, 0.5, inputs=Inputs(**inputs))


def asked(text: str, at: Moment | None = None, places: Any = CELLS) -> Any:
    return parsed(text, "strength").at(at or moment(), places)


def test_shapes_lie_in_the_world_and_fade_over_their_soft_edge() -> None:
    away = np.linalg.norm(WORLD - [1, 2, 3], axis=1)
    np.testing.assert_array_equal(asked("sphere(1,2,3, 1.2)"), away <= 1.2)
    soft = asked("sphere(1,2,3, 0.5, soft=1)")
    np.testing.assert_array_equal(soft[away <= 0.5], 1)
    np.testing.assert_array_equal(soft[away >= 1.5], 0)
    np.testing.assert_allclose(soft[np.isclose(away, 1)], 0.5, atol=1e-6)
    inside = ((WORLD >= [1, 0, 1]) & (WORLD <= [2, 9, 3])).all(axis=1)
    np.testing.assert_array_equal(asked("box(2,0,1, 1,9,3)"), inside)
    assert asked("box(1,0,1, 2,9,3, soft=1)")[inside].min() == 1
    np.testing.assert_array_equal(
        asked("sphere(1,2,3, 1:0 3:2.4)", moment(2)), asked("sphere(1,2,3,1.2)")
    )


def test_where_y_is_up_shapes_are_meant_as_the_file_has_it() -> None:
    # Ours is (x, y, z) = its (z, x, y).
    there = asked("sphere(2,3,1, 1.2)", moment(up="y"))
    np.testing.assert_array_equal(there, asked("sphere(1,2,3, 1.2)"))
    np.testing.assert_allclose(asked("y", moment(up="y")), WORLD[:, 2])


def test_a_picture_is_thrown_from_where_a_film_is_taken(tmp_path: Path) -> None:
    picture = np.zeros((64, 64, 3), np.float32)
    picture[:, 32:] = 1
    picture[:10] = 0.2140411  # half as bright, as it looks
    path = tmp_path / "mask.png"
    write_image(path, picture)
    at = moment()
    text = f'picture("{path}", azimuth=30, elevation=20, field_of_view=0)'
    camera = frame_box(*(each.tolist() for each in at.bounds), 30, 20)
    row, column, _ = camera.project(WORLD, 64, 64)
    found = asked(text, at)
    np.testing.assert_array_equal(found[(column > 33) & (row > 11)], 1)
    np.testing.assert_array_equal(
        found[column < 31.5 - 1], found[column < 31.5 - 1] * (row < 10)[column < 31.5 - 1]
    )
    top = (row < 9) & (row > 0)
    np.testing.assert_allclose(found[top], 0.5, atol=0.01)


@pytest.mark.parametrize("up", ["z", "y"])
def test_a_mesh_holds_inside_and_falls_off_outside(tmp_path: Path, up: Any) -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.3)
    ball.apply_translation([2, 2.2, 1.8] if up == "z" else [2.2, 1.8, 2])
    path = tmp_path / "ball.obj"
    if up == "z":  # what a program with +z up writes: (x, z, −y)
        ball.vertices = ball.vertices[:, [0, 2, 1]] * [1, 1, -1]
    ball.export(path)
    away = np.linalg.norm(WORLD - [2, 2.2, 1.8], axis=1)
    hard = asked(f'mesh("{path}")', moment(up=up))
    np.testing.assert_array_equal(hard[away < 1.27], 1)
    np.testing.assert_array_equal(hard[away > 1.3 + 0.9], 0)
    soft = asked(f'mesh("{path}", soft=1.5)', moment(up=up))
    np.testing.assert_array_equal(soft[away < 1.27], 1)
    np.testing.assert_array_equal(soft[away > 1.3 + 1.5 + 0.5], 0)
    ring = np.abs(away - 1.3 - 0.75) < 0.1
    assert np.abs(soft[ring] - 0.5).max() < 0.3


def test_distances_are_those_of_all_pairs() -> None:
    marked = np.random.default_rng(0).random((12, 10, 11)) < 0.01
    field = Field.from_dense(
        np.where(marked, 0, np.inf).astype(np.float32),
        (-3, 5, 0),
        outside=np.float32(np.inf),
        held=np.ones(marked.shape, bool),
    )
    every = np.argwhere(np.ones(marked.shape, bool))
    away = np.linalg.norm(every[:, None] - np.argwhere(marked), axis=-1).min(axis=1)
    found = distances(field, 7).dense().reshape(-1)
    np.testing.assert_allclose(found, np.minimum(away, 7), atol=1e-6)


def test_distance_is_how_deep_a_cell_lies() -> None:
    density = np.zeros((SIZE, SIZE, SIZE), np.float32)
    density[1:8, 1:8, 1:8] = 1
    depth = asked("distance", moment(density=density)).reshape(SIZE, SIZE, SIZE)
    np.testing.assert_allclose(depth[4, 4], [0, 0.5, 1.5, 2.5, 3.5, 2.5, 1.5, 0.5, 0])
    halfway = asked("distance", moment(density=density), np.array([[4.0, 4.0, 1.5]]))
    np.testing.assert_allclose(halfway, 1.0)


def told(smoke: Path, frame: int = 1, missing: Any = "stop") -> Moment:
    frames = find_frames(smoke)
    volume = read_smoke(frames[frame - 1].path, frame=frame)
    paths = {each.number: each.path for each in frames}
    return Moment(volume, volume.box, 0.01, inputs=Inputs(paths, "z", missing))


def test_a_grid_is_sampled_where_it_lies(smoke: Path, add_grid: Callable[..., None]) -> None:
    fine = np.stack(np.meshgrid(*[np.arange(40)] * 3, indexing="ij"), axis=-1)
    add_grid("ramp", (fine[..., 0] + 1).astype(np.float32), cell=0.25)
    at = told(smoke)
    cells = np.array([[4, 5, 6], [7, 2, 3]], np.int32)
    # Two fine cells in each: numbers 8 and 9 of them, which hold 9 and 10.
    np.testing.assert_allclose(asked("@ramp", at, cells), [9.5, 15.5])
    np.testing.assert_allclose(asked("@ramp:0..20", at, cells), [9.5 / 20, 15.5 / 20])
    np.testing.assert_allclose(asked("@ramp", at, np.array([[4.25, 5, 6]])), [10])
    # Beyond its cells there is its background.
    np.testing.assert_array_equal(asked("@ramp", at, np.array([[-5, 2, 2]], np.int32)), 0)


def test_grids_of_other_files_are_still_or_go_frame_by_frame(
    smoke: Path, add_grid: Callable[..., None], tmp_path: Path
) -> None:
    for frame in (1, 2, 3):
        values = np.full((16, 16, 16), frame, np.float32)
        add_grid("m", values, to=tmp_path / f"mask_{frame:04d}.vdb")
    cells = np.array([[4, 5, 6]], np.int32)
    pattern, still = tmp_path / "mask_####.vdb", tmp_path / "mask_0003.vdb"
    for frame in (1, 2, 3):
        at = told(smoke, frame)
        assert asked(f'grid("{pattern}", "m")', at, cells) == frame
        assert asked(f'grid("{still}")', at, cells) == 3
    (tmp_path / "mask_0002.vdb").unlink()
    value: Any = parsed(f'grid("{pattern}")', "strength")
    with pytest.raises(SequenceError, match="no file for frame 2; choose `missing`"):
        value.require(told(smoke).inputs)
    assert value.at(told(smoke, 2, "zero"), cells) == 0
    assert value.at(told(smoke, 2, "hold"), cells) == 1


def test_a_grid_that_frames_lack_stops_or_is_zero_or_held(
    smoke: Path, add_grid: Callable[..., None]
) -> None:
    add_grid("m", np.full((16, 16, 16), 0.5, np.float32), (1, 3))
    cells = np.array([[4, 5, 6]], np.int32)
    value: Any = parsed("@m", "strength")
    with pytest.raises(GridError, match=r"ball_0002.vdb: no grid 'm' among .*density.*, or one wi"):
        value.require(told(smoke).inputs)
    with pytest.raises(GridError, match=r"ball_0002\.vdb"):
        value.at(told(smoke, 2), cells)
    for missing, number in (("zero", 0), ("hold", 0.5)):
        at = told(smoke, 2, missing)
        value.require(at.inputs)
        assert value.at(at, cells) == number
    none: Any = parsed("@none", "strength")
    with pytest.raises(GridError, match="in this or any other frame"):
        none.require(told(smoke, 1, "zero").inputs)


def test_a_grid_that_is_not_finite_or_no_number_is_refused(
    smoke: Path, add_grid: Callable[..., None]
) -> None:
    values = np.ones((16, 16, 16), np.float32)
    values[3, 3, 3] = np.nan
    add_grid("m", values)
    cells = np.array([[4, 5, 6]], np.int32)
    with pytest.raises(GridError, match=r"ball_0001.vdb: grid 'm': 1 of 4096 values are NaN"):
        asked("@m", told(smoke), cells)
    value: Any = parsed("@velocity", "strength")
    with pytest.raises(GridError, match="'velocity' holds vectors, expected numbers"):
        value.require(told(smoke).inputs)


def test_fields_in_memory_are_grids_too() -> None:
    at = moment()
    heat = np.arange(SIZE**3, dtype=np.float32).reshape(SIZE, SIZE, SIZE)
    at = replace(at, smoke=replace(at.smoke, fields={"heat": heat}))
    np.testing.assert_array_equal(asked("@heat", at), heat.reshape(-1))


def moving(frame: int) -> Moment:
    """A block of smoke three cells wide that has gone a cell a frame along x."""
    density = np.zeros((SIZE + 6, SIZE, SIZE), np.float32)
    density[frame : frame + 3, 2:7, 2:7] = 1
    velocity = np.zeros((*density.shape, 3), np.float32)
    velocity[..., 0] = 1
    return moment(frame, density, velocity)


def test_what_is_advected_goes_along_and_smoke_that_appears_is_young() -> None:
    mark, age = parsed("advected(z:0..4)", "strength"), parsed("age", "strength")
    values, carried = [mark, age], None
    for frame in (1, 2, 3, 4):
        at = moving(frame)
        if frame == 4:  # more appears, beside it
            density = at.smoke.density.copy()
            density[10:12, 2:7, 2:7] = 1
            at = replace(at, smoke=replace(at.smoke, density=density))
        carried = carry(carried, values, at)
        at = replace(at, carried=carried)
        cells = np.array([[frame + 1, 4, 4], [frame + 1, 4, 6], [10, 4, 4]], np.int32)
        np.testing.assert_allclose(mark.at(at, cells)[:2], [0.5, 0.75], atol=1e-6)
        np.testing.assert_array_equal(age.at(at, cells), [frame - 1, frame - 1, 0])


def test_nothing_is_carried_where_nothing_asks() -> None:
    assert carry(None, [parsed("1 - density", "strength")], moving(1)) is None
    empty = Carried(np.zeros((0, 3), np.int32), {"a": np.zeros(0, np.float32)})
    assert not empty.at("a", CELLS)[1].any()


def test_a_box_without_smoke_asks_for_nothing() -> None:
    nothing = Volume(np.zeros((0, 0, 0), np.float32), None, (0, 0, 0), np.eye(4), 1)
    at = Moment(nothing, Box((0, 0, 0), (4, 4, 4)))
    none = np.zeros((0, 3), np.int32)
    for text in ("@m", "density", "speed", "distance", "age", "sphere(0,0,0,1)", "height"):
        assert np.size(asked(text, at, none)) in (0, 1)
    assert carry(None, parsed("age", "strength").parts(), at) is not None
