from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core import AnyArray, Box, Index
from vnca.core.errors import FileFormatError, GridError, OptionError, SequenceError
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, smoke_box, with_fitted_scale, write_smoke
from vnca.io.sequence import Frame
from vnca.io.smoke_format import reader_of, register_reader
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb

PLAIN = SmokeFormat()
HEATED = SmokeFormat(fields=("temperature",))
TRANSFORM = Transform.uniform(0.5, (1, 2, 3))
SHAPE = (5, 6, 7)
ORIGIN = (10, -3, 2)


def grid(
    name: str,
    values: AnyArray,
    *,
    active: AnyArray | None = None,
    origin: Index = ORIGIN,
    transform: Transform = TRANSFORM,
    grid_class: str = "fog volume",
    **options: Any,
) -> Grid:
    active = np.ones(values.shape[:3], np.bool_) if active is None else active
    return Grid.from_dense(
        name, values, active, origin, transform=transform, grid_class=grid_class, **options
    )


def saved(path: Path, *grids: Grid) -> Path:
    write_vdb(path, grids)
    return path


def density(seed: int = 0) -> AnyArray:
    return np.random.default_rng(seed).random(SHAPE, np.float32) + np.float32(0.1)


def vectors(seed: int = 1) -> AnyArray:
    return np.random.default_rng(seed).standard_normal((*SHAPE, 3)).astype(np.float32)


def test_a_frame_arrives_with_its_place_and_its_motion(tmp_path: Path) -> None:
    path = saved(tmp_path / "s.vdb", grid("density", density()), grid("velocity", vectors()))
    volume = read_smoke(path, PLAIN, frame=12)
    np.testing.assert_array_equal(volume.density, density())
    np.testing.assert_array_equal(volume.velocity, vectors())
    assert (volume.origin, volume.frame) == (ORIGIN, 12)
    np.testing.assert_array_equal(volume.index_to_world, TRANSFORM.index_to_world)
    assert volume.box == smoke_box(path, PLAIN)


def test_only_active_cells_hold_smoke(tmp_path: Path) -> None:
    active = density() > 0.6
    active[0], active[:, -1] = False, False
    path = saved(tmp_path / "s.vdb", grid("density", density(), active=active))
    volume = read_smoke(path, PLAIN)
    expected = np.where(active, density(), 0)[1:, :-1]
    np.testing.assert_array_equal(volume.density, expected)
    assert volume.box == Box((11, -3, 2), (15, 2, 9)) == smoke_box(path, PLAIN)
    assert volume.velocity is None


def test_velocity_under_the_smoke_is_centred_and_continued(tmp_path: Path) -> None:
    """As in Blender's cache: staggered by class, stored only where there is density."""
    shape = (14, 4, 4)
    smoke = np.zeros(shape, np.float32)
    smoke[[0, 13]] = 1
    stored = np.zeros(shape, np.bool_)
    stored[:3] = True
    x = np.indices(shape, dtype=np.float32)[0]
    faces = np.stack([x, 0 * x + 2, 0 * x], axis=-1)
    path = saved(
        tmp_path / "s.vdb",
        grid("density", smoke),
        grid("velocity", faces, active=stored, grid_class="staggered"),
    )
    volume = read_smoke(path, PLAIN)
    assert volume.velocity is not None
    along = volume.velocity[:, 1, 1]
    np.testing.assert_allclose(along[:, 0], [0.5, 1.5, 2, 2, 2, 2, 2] + [0] * 7)
    np.testing.assert_allclose(along[:, 1], [2] * 7 + [0] * 7)
    centres = read_smoke(path, SmokeFormat(staggered=False)).velocity
    assert centres is not None
    np.testing.assert_allclose(centres[:3, 1, 1, 0], [0, 1, 2])


@pytest.mark.parametrize("name", ["velocity", "vel", "v"])
@pytest.mark.parametrize("scalars", [False, True])
def test_velocity_is_found_under_its_usual_names(tmp_path: Path, name: str, scalars: bool) -> None:
    values = vectors()
    parts = (
        [grid(f"{name}.{axis}", values[..., a].copy()) for a, axis in enumerate("xyz")]
        if scalars
        else [grid(name, values)]
    )
    path = saved(tmp_path / "s.vdb", grid("density", density()), *parts)
    np.testing.assert_array_equal(read_smoke(path, PLAIN).velocity, values)
    assert read_smoke(path, SmokeFormat(velocity_grid="none")).velocity is None


def test_grids_can_be_chosen_by_name(tmp_path: Path) -> None:
    path = saved(
        tmp_path / "s.vdb",
        grid("density", density()),
        grid("velocity", vectors()),
        grid("soot", density(5)),
        grid("wind", vectors(6)),
    )
    volume = read_smoke(path, SmokeFormat(density_grid="soot", velocity_grid="wind"))
    np.testing.assert_array_equal(volume.density, density(5))
    np.testing.assert_array_equal(volume.velocity, vectors(6))


def test_scalar_grids_on_faces_say_so_by_their_place(tmp_path: Path) -> None:
    """As in Houdini's files: each component is shifted by half a cell, with one cell more."""
    shape = np.array(SHAPE)
    parts = []
    for axis in range(3):
        more = np.eye(3, dtype=int)[axis]
        faces = np.indices(tuple(shape + more), dtype=np.float32)[axis] * (axis + 1)
        moved = Transform.uniform(0.5, np.array([1, 2, 3]) - 0.25 * more)
        parts.append(grid(f"vel.{'xyz'[axis]}", faces, transform=moved))
    path = saved(tmp_path / "s.vdb", grid("density", density()), *parts)
    velocity = read_smoke(path, PLAIN).velocity
    expected = np.stack([(a + 1) * (np.indices(SHAPE)[a] + 0.5) for a in range(3)], axis=-1)
    np.testing.assert_allclose(velocity, expected)


@pytest.mark.parametrize(
    ("options", "factor"),
    [
        ({"velocity_units": "m/s", "fps": 20, "time_scale": 0.4}, 0.4 / 20 / 0.5),
        ({"velocity_units": "mantaflow", "fps": 24, "time_scale": 0.4}, 1 / 24),
        ({"velocity_scale": 0.8}, 0.8),
        ({"velocity_units": "m/s", "fps": 1, "velocity_scale": 3}, 6),
    ],
)
def test_units_and_scale_are_applied(
    tmp_path: Path, options: dict[str, Any], factor: float
) -> None:
    path = saved(tmp_path / "s.vdb", grid("density", density()), grid("velocity", vectors()))
    velocity = read_smoke(path, SmokeFormat(**options)).velocity
    np.testing.assert_allclose(velocity, vectors() * np.float32(factor), rtol=1e-6)


def test_a_file_that_says_its_units_is_believed(tmp_path: Path) -> None:
    volume = Volume(np.ones((3, 3, 3), np.float32), None, (0, 0, 0), np.eye(4), 1)
    velocity = np.full((3, 3, 3, 3), 2, np.float32)
    write_smoke(tmp_path / "a.vdb", replace(volume, velocity=velocity))
    other = SmokeFormat(velocity_units="mantaflow", fps=30, time_scale=0.4, velocity_scale=0.8)
    np.testing.assert_array_equal(read_smoke(tmp_path / "a.vdb", other).velocity, velocity)


def test_smoke_can_be_written_as_half_floats(tmp_path: Path) -> None:
    volume = drifting(3, speed=4)
    write_smoke(tmp_path / "a.vdb", volume, half=True)
    with open_vdb(tmp_path / "a.vdb") as file:
        assert all(header.is_half for header in file.grids.values())
    got = read_smoke(tmp_path / "a.vdb", PLAIN)
    assert volume.velocity is not None
    np.testing.assert_allclose(got.density.sum(), volume.density.sum(), rtol=1e-3)
    assert got.velocity.max() == volume.velocity.max()


def test_files_with_y_up_are_turned(tmp_path: Path) -> None:
    path = saved(tmp_path / "s.vdb", grid("density", density()), grid("velocity", vectors()))
    form = SmokeFormat(up_axis="y")
    volume = read_smoke(path, form)
    np.testing.assert_array_equal(volume.density, density().transpose(2, 0, 1))
    np.testing.assert_array_equal(volume.velocity, vectors().transpose(2, 0, 1, 3)[..., [2, 0, 1]])
    assert volume.box == smoke_box(path, form) == Box((2, 10, -3), (9, 15, 3))
    x, y, z, _ = TRANSFORM.index_to_world @ (*ORIGIN, 1)
    np.testing.assert_array_equal(volume.index_to_world @ (2, 10, -3, 1), (z, x, y, 1))


def test_metres_per_second_are_turned_after_they_are_scaled(tmp_path: Path) -> None:
    stretched = Transform.from_matrix(np.diag([0.5, 0.25, 0.125, 1.0]))
    wind = np.broadcast_to(np.float32([1, 2, 3]), (*SHAPE, 3)).copy()
    path = saved(
        tmp_path / "s.vdb",
        grid("density", density(), transform=stretched),
        grid("vel", wind, transform=stretched),
    )
    volume = read_smoke(path, SmokeFormat(velocity_units="m/s", fps=1, up_axis="y"))
    assert volume.velocity is not None
    np.testing.assert_allclose(volume.velocity[0, 0, 0], [24, 2, 8])
    assert volume.voxel_size == (0.125, 0.5, 0.25)


def test_a_frame_without_smoke_has_no_cells(tmp_path: Path) -> None:
    nothing = np.zeros(SHAPE, np.bool_)
    path = saved(
        tmp_path / "s.vdb",
        grid("density", density(), active=nothing),
        grid("velocity", vectors(), active=nothing, grid_class="staggered"),
    )
    for up in ("z", "y"):
        volume = read_smoke(path, SmokeFormat(up_axis=up))
        assert volume.density.shape == (0, 0, 0)
        assert volume.velocity is not None
        assert volume.velocity.shape == (0, 0, 0, 3)
        assert volume.box.is_empty
        assert volume.box == smoke_box(path, SmokeFormat(up_axis=up))


def test_resting_smoke_may_store_no_velocity(tmp_path: Path) -> None:
    path = saved(
        tmp_path / "s.vdb",
        grid("density", density()),
        grid("velocity", vectors(), active=np.zeros(SHAPE, np.bool_)),
    )
    velocity = read_smoke(path, PLAIN).velocity
    assert velocity is not None
    assert not velocity.any()


@pytest.mark.parametrize("dtype", [np.float64, np.int32, np.int64, np.bool_])
def test_density_of_other_numbers_is_read(tmp_path: Path, dtype: type) -> None:
    values = (density() * 2).astype(dtype)
    volume = read_smoke(saved(tmp_path / "s.vdb", grid("density", values)), PLAIN)
    assert volume.density.dtype == np.float32
    np.testing.assert_array_equal(volume.density, values.astype(np.float32))


def test_the_box_is_found_without_its_metadata(tmp_path: Path) -> None:
    path = saved(tmp_path / "s.vdb", grid("density", density()))
    data = path.read_bytes()
    for word in (b"file_bbox_min", b"file_bbox_max"):
        data = data.replace(word, b"x" + word[1:])
    path.write_bytes(data)
    with open_vdb(path) as file:
        assert file.grids["density"].box is None
    assert smoke_box(path, PLAIN) == read_smoke(path, PLAIN).box == Box(ORIGIN, (15, 3, 9))


def test_slightly_negative_density_becomes_zero_and_more_is_refused(tmp_path: Path) -> None:
    values = density()
    values[0, 0, 0] = -0.05
    volume = read_smoke(saved(tmp_path / "s.vdb", grid("density", values)), PLAIN)
    assert volume.density[0, 0, 0] == 0
    values[0, 0, 0] = -0.5
    with pytest.raises(GridError, match=r"density goes from -0.5 .* `density_grid`"):
        read_smoke(saved(tmp_path / "s.vdb", grid("density", values)), PLAIN)


def spoiled(values: AnyArray, bad: float) -> AnyArray:
    values[1, 2, 3] = bad
    return values


@pytest.mark.parametrize(
    ("grids", "options", "words"),
    [
        (
            [grid("soot", density()), grid("Cd", vectors())],
            {},
            r"no density grid 'density'; choose with `density_grid` from soot \(float\)$",
        ),
        (
            [grid("Cd", vectors()), grid("surface", density(), grid_class="level set")],
            {},
            r"no density grid 'density'; there is Cd \(vec3s\), surface \(float\), and no other",
        ),
        ([grid("density", vectors())], {}, "holds vectors, expected numbers"),
        (
            [grid("density", density(), grid_class="level set")],
            {},
            "is a level set, expected a fog",
        ),
        (
            [grid("density", spoiled(density(), np.nan))],
            {},
            "grid 'density': 1 of 210 values are NaN",
        ),
        (
            [grid("density", density()), grid("vel", spoiled(vectors(), np.inf))],
            {},
            "grid 'vel': 3 of 630 values are NaN, infinite",
        ),
        (
            [grid("density", density()), grid("vel.x", density()), grid("vel.z", density())],
            {},
            r"velocity 'vel' lacks the scalar grid vel\.y; leave .* `velocity_grid` none",
        ),
        (
            [grid("density", density())],
            {"velocity_grid": "wind"},
            r"no velocity 'wind'; choose with `velocity_grid` .* density \(float\)",
        ),
        (
            [grid("density", density()), grid("v", vectors(), origin=(40, 0, 0))],
            {},
            r"grid 'v' covers cells \(40, 0, 0\) to \(45, .* do not meet; .*`velocity_grid` none",
        ),
        (
            [grid("density", density()), grid("v", vectors())],
            {"velocity_scale": "fit"},
            "velocity_scale: fit needs a sequence",
        ),
        (
            [grid("density", density()), grid("v", vectors())],
            {"velocity_scale": float("nan")},
            "velocity_scale: expected a finite number",
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(
    tmp_path: Path, grids: Iterable[Grid], options: dict[str, Any], words: str
) -> None:
    path = saved(tmp_path / "s.vdb", *grids)
    with pytest.raises((GridError, OptionError), match=words) as caught:
        read_smoke(path, SmokeFormat(**options))
    assert "\n" not in str(caught.value)
    if isinstance(caught.value, GridError):
        assert str(caught.value).startswith(str(path))


FLAT = Transform.from_matrix(
    np.block(
        [
            [np.diag([0.5, 1e-29, 0.5]), np.array([[1], [2], [3]])],
            [np.zeros((1, 3)), np.ones((1, 1))],
        ]
    )
)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("factor", "transform", "options", "grid_class"),
    [
        (1e20, FLAT, {}, "fog volume"),  # On voxels of its own, each of very many of the density's.
        (3e20, TRANSFORM, {"velocity_units": "m/s", "fps": 0.1}, "fog volume"),
        (1e20, TRANSFORM, {"velocity_scale": 1e30}, "fog volume"),
        (1e38, TRANSFORM, {}, "staggered"),
    ],
)
def test_a_velocity_beyond_all_numbers_is_refused(
    tmp_path: Path, factor: float, transform: Transform, options: dict[str, Any], grid_class: str
) -> None:
    path = saved(
        tmp_path / "s.vdb",
        grid("density", density(), transform=transform),
        grid("velocity", np.full((*SHAPE, 3), 3 * factor, np.float32), grid_class=grid_class),
    )
    with pytest.raises(GridError, match=r"s\.vdb: velocity of more than 1e\+20 cells per frame"):
        read_smoke(path, SmokeFormat(**options))
    read_smoke(path, SmokeFormat(velocity_grid="none"))


def test_metadata_that_lies_about_the_extent_is_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "s.vdb", grid("density", density()))
    data = path.read_bytes()
    corner = np.array([14, 2, 8], "<i4").tobytes()
    assert data.count(corner) == 1
    path.write_bytes(data.replace(corner, np.array([13, 2, 8], "<i4").tobytes()))
    with pytest.raises(FileFormatError, match="active cells outside the box its metadata gives"):
        read_smoke(path, PLAIN)


def test_files_of_other_kinds_are_named(tmp_path: Path) -> None:
    other = tmp_path / "s.obj"
    other.write_text("v 0 0 0")
    for act in (read_smoke, smoke_box):
        with pytest.raises(FileFormatError, match=r"expected a file of smoke \(\.vdb, \.npz\)"):
            act(other, PLAIN)
        with pytest.raises(FileFormatError, match="no such file"):
            act(tmp_path / "none.vdb", PLAIN)


def drifting(frame: int, speed: float) -> Volume:
    """A blob that moves by one cell a frame and says it moves by `speed`."""
    x, y, z = np.indices((16, 9, 9), dtype=np.float32)
    values = np.exp(-((x - 5 - frame) ** 2 + (y - 4) ** 2 + (z - 4) ** 2) / 5).astype(np.float32)
    velocity = np.broadcast_to(np.float32([speed, 0, 0]), (*values.shape, 3)).copy()
    return Volume(values, velocity, (0, 0, 0), np.diag([0.1, 0.1, 0.1, 1]), frame)


def test_the_velocity_scale_is_fitted_to_neighbouring_frames(tmp_path: Path) -> None:
    form = SmokeFormat(velocity_scale="fit", fps=30)
    frames = [Frame(number, tmp_path / f"s{number}.vdb") for number in (0, 2, 3)]
    for number, path in frames:
        write_smoke(path, drifting(number, speed=4))
    fitted = with_fitted_scale(form, frames)
    assert fitted.velocity_scale == pytest.approx(0.25, rel=0.03)
    assert replace(fitted, velocity_scale="fit") == form
    assert with_fitted_scale(PLAIN, frames) is PLAIN
    with pytest.raises(SequenceError, match="fit needs two neighbouring frames"):
        with_fitted_scale(form, frames[:2])
    # Also where the grid moves along, and where its axes are others.
    other = drifting(3, speed=4)
    matrix = other.index_to_world.copy()
    matrix[0, 3] = 0.7
    write_smoke(frames[2].path, replace(other, origin=(-7, 0, 0), index_to_world=matrix))
    assert with_fitted_scale(form, frames).velocity_scale == fitted.velocity_scale
    matrix = np.diag([-0.1, 0.1, 0.1, 1.0])
    density = np.ascontiguousarray(other.density[::-1])
    write_smoke(frames[2].path, Volume(density, other.velocity, (-15, 0, 0), matrix, 3))
    assert with_fitted_scale(form, frames).velocity_scale == fitted.velocity_scale
    write_smoke(frames[2].path, drifting(3, speed=-4))
    write_smoke(frames[1].path, drifting(2, speed=-4))
    with pytest.raises(GridError, match="no velocity scale up to 4"):
        with_fitted_scale(form, frames)


def test_further_grids_are_read_onto_the_cells_of_the_density(tmp_path: Path) -> None:
    active = np.ones(SHAPE, np.bool_)
    active[0] = False
    heat = grid("temperature", 300 + density(3), active=active)
    path = saved(tmp_path / "s.vdb", grid("density", density()), heat)
    assert read_smoke(path, PLAIN).fields == {}
    (name, found), *others = read_smoke(path, HEATED).named_fields.items()
    assert (name, others) == ("temperature", [])
    np.testing.assert_array_equal(found.dense(), np.where(active, 300 + density(3), 0))
    # On other cells they go where the density goes.
    mirrored = Transform.from_matrix(np.diag([-0.5, 0.5, 0.5, 1]))
    grids = [grid(n, density(), transform=mirrored) for n in ("density", "temperature")]
    smoke = read_smoke(saved(tmp_path / "m.vdb", *grids), HEATED, lattice=Lattice(np.eye(4)))
    np.testing.assert_allclose(smoke.named_fields["temperature"].dense(), smoke.density)


def test_a_further_grid_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    plain = grid("density", density())
    for name, other, words in (
        ("a.vdb", grid("heat", density()), "no grid 'temperature'; choose `fields` from density"),
        ("b.vdb", grid("temperature", vectors()), "grid 'temperature' holds vec3s, expected num"),
        (
            "c.vdb",
            grid("temperature", density(), transform=Transform.uniform(1)),
            "grid 'temperature' has other cells than the density",
        ),
    ):
        with pytest.raises(GridError, match=rf"{name}: {words}"):
            read_smoke(saved(tmp_path / name, plain, other), HEATED)
    np.savez(tmp_path / "d.npz", x=density())
    with pytest.raises(OptionError, match="`fields` temperature: an npz file has none"):
        read_smoke(tmp_path / "d.npz", HEATED)


def test_a_reader_is_not_registered_for_a_format_of_our_own(tmp_path: Path) -> None:
    for suffix in (".vdb", ".SMOKE", "smoke"):
        with pytest.raises(OptionError, match="expected one such as"):
            register_reader(suffix, reader_of(tmp_path / "a.npz"))
