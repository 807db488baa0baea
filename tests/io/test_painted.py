import os
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.errors import GridError, OptionError, OutputError, ShapeError
from vnca.core.volume import Volume
from vnca.io import read_smoke, smoke_box, with_fitted_scale
from vnca.io.painted import read_colour, write_painted, write_smoke
from vnca.io.sequence import find_frames
from vnca.io.smoke_format import SmokeFormat
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb

PLAIN = SmokeFormat()
SHAPE = (9, 5, 6)
ORIGIN = (-4, 3, 7)
SHARED = Path(os.environ.get("VNCA_SHARED_DATA", Path(__file__).parents[3] / "shared" / "data"))
CACHE = SHARED / "smoke" / "plume_sphere"
needs_cache = pytest.mark.skipif(not CACHE.is_dir(), reason="no shared data")


def random(*shape: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).random(shape, np.float32) + np.float32(0.25)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Density in half floats in an irregular shape, and other grids."""
    active = random(*SHAPE, seed=1) > 0.6
    active[0, 0, 0] = active[-1, -1, -1] = True
    transform = Transform.uniform(0.25, (1, 2, 3))

    def grid(name: str, values: AnyArray, **options: bool) -> Grid:
        extra = {"note": f"of {name}"}
        return Grid.from_dense(
            name, values, active, ORIGIN, transform=transform, metadata=extra, **options
        )

    grids = [
        grid("heat", random(*SHAPE, seed=2)),
        grid("density", random(*SHAPE, seed=3), half=True),
        grid("Cd", random(*SHAPE, 3, seed=4)),
        grid("velocity", random(*SHAPE, 3, seed=5)),
    ]
    write_vdb(tmp_path / "source.vdb", grids, metadata={"scene": "test"})
    return tmp_path / "source.vdb"


def painting(volume: Volume) -> tuple[FloatArray, FloatArray]:
    """Density doubled, and the colour of each cell tells where it is."""
    position = np.stack(np.indices(volume.density.shape), axis=-1) + volume.origin
    return volume.density * 2, (position / 64).astype(np.float32)


@pytest.mark.parametrize("up", ["z", "y"])
def test_a_painted_file_has_new_density_and_colour_and_all_the_rest(
    source: Path, tmp_path: Path, up: str
) -> None:
    form = SmokeFormat(up_axis="y" if up == "y" else "z")
    volume = read_smoke(source, form)
    density, colour = painting(volume)
    target = tmp_path / "out" / "painted.vdb"
    write_painted(target, source, form, density=density, colour=colour, box=volume.box)
    painted = read_smoke(target, form)
    np.testing.assert_allclose(painted.density, density, rtol=1e-3)
    np.testing.assert_array_equal(painted.index_to_world, volume.index_to_world)
    with open_vdb(source) as before, open_vdb(target) as after:
        assert after.names == ("heat", "density", "velocity", "Cd")
        assert after.metadata.value("scene") == "test"
        for name in ("heat", "velocity"):
            np.testing.assert_array_equal(
                after.read(name).tree.leaf_values, before.read(name).tree.leaf_values
            )
        old, new, cd = before.read("density"), after.read("density"), after.read("Cd")
        for grid in (new, cd):
            assert grid.is_half
            assert grid.transform == old.transform
        np.testing.assert_array_equal(new.tree.leaf_active, old.tree.leaf_active)
        np.testing.assert_array_equal(new.tree.leaf_origins, old.tree.leaf_origins)
        assert new.metadata.value("note") == "of density"
        assert "note" not in cd.metadata
        values, active = cd.to_dense(Box(ORIGIN, (5, 8, 13)))
        cell = (2, 4, 1)
        assert active[cell]
        x, y, z = (start + step for start, step in zip(ORIGIN, cell, strict=True))
        ours = (z, x, y) if up == "y" else (x, y, z)
        np.testing.assert_allclose(values[cell], np.array(ours) / 64, rtol=1e-3)


@pytest.mark.parametrize("refine", [1, 2])
def test_colours_go_on_for_a_cell_around_the_smoke(
    source: Path, tmp_path: Path, refine: int
) -> None:
    volume = read_smoke(source, PLAIN).refined(refine)
    target = tmp_path / "painted.vdb"
    density = volume.density
    colour = np.where((density > 0)[..., None], np.float32(0.25), np.float32(9))
    write_painted(
        target, source, PLAIN, density=density, colour=np.ascontiguousarray(colour.repeat(3, 3)),
        box=volume.box, refine=refine,
    )  # fmt: skip
    with open_vdb(target) as file:
        smoke, paint = file.read("density"), file.read("Cd")
        box = smoke.active_box().grown(2)
        active, (values, coloured) = smoke.to_dense(box)[1], paint.to_dense(box)
    np.testing.assert_array_equal(coloured, binary_dilation(active, np.ones((3, 3, 3))))
    if refine > 1:  # else cells without density are active in the source
        assert values[coloured] == pytest.approx(0.25, abs=1e-3)
    assert not values[~coloured].any()


@pytest.mark.parametrize("up", ["z", "y"])
def test_finer_paint_lies_where_the_smoke_does_and_all_the_rest_stays(
    source: Path, tmp_path: Path, up: Literal["z", "y"]
) -> None:
    form = SmokeFormat(up_axis=up)
    fine = read_smoke(source, form).refined(2)
    density, colour = painting(fine)
    target = tmp_path / "painted.vdb"
    write_painted(target, source, form, density=density, colour=colour, box=fine.box, refine=2)
    painted = read_smoke(target, replace(form, velocity_grid="none"))
    inside = painted.box.slices(fine.box)
    np.testing.assert_allclose(painted.density, density[inside], rtol=1e-3)
    np.testing.assert_allclose(painted.index_to_world, fine.index_to_world)
    seen = read_colour(target, form, grid="Cd", box=fine.box)
    assert seen is not None
    shown = density > 0
    np.testing.assert_allclose(seen[shown], colour[shown], rtol=1e-3)
    assert not seen[~binary_dilation(shown, np.ones((3, 3, 3)))].any()
    with open_vdb(source) as before, open_vdb(target) as after:
        assert after.read("density").is_half
        for name in ("heat", "velocity"):
            assert after.grids[name].transform == before.grids[name].transform
            np.testing.assert_array_equal(
                after.read(name).tree.leaf_values, before.read(name).tree.leaf_values
            )


def test_colour_can_have_other_names_and_a_larger_box(source: Path, tmp_path: Path) -> None:
    volume = read_smoke(source, PLAIN)
    density, colour = painting(volume)
    box = volume.box.grown(2)
    target = tmp_path / "painted.vdb"
    write_painted(
        target,
        source,
        PLAIN,
        density=np.pad(density, 2, constant_values=9),
        colour=np.pad(colour, [(2, 2)] * 3 + [(0, 0)], constant_values=9),
        box=box,
        colour_grids=("color", "paint"),
    )
    with open_vdb(target) as file:
        assert file.names == ("heat", "density", "Cd", "velocity", "color", "paint")
        active = file.read("density").to_dense(volume.box)[1]
        for name in ("color", "paint"):
            values = file.read(name).to_dense(box)[0]
            np.testing.assert_allclose(values[2:-2, 2:-2, 2:-2][active], colour[active], rtol=1e-3)
            assert values.max() < 9


def test_density_beyond_half_floats_does_not_become_infinite(source: Path, tmp_path: Path) -> None:
    volume = read_smoke(source, PLAIN)
    density, colour = painting(volume)
    target = tmp_path / "painted.vdb"
    write_painted(target, source, PLAIN, density=density * 1e6, colour=colour, box=volume.box)
    assert read_smoke(target, PLAIN).density.max() == 65504


@pytest.mark.parametrize("dtype", [np.float64, np.int32, np.bool_])
def test_painted_density_is_never_cut_to_whole_numbers(tmp_path: Path, dtype: type) -> None:
    source, target = tmp_path / "source.vdb", tmp_path / "painted.vdb"
    values = np.ones((3, 3, 3), dtype)
    active, transform = np.ones((3, 3, 3), np.bool_), Transform.uniform(1)
    write_vdb(source, [Grid.from_dense("density", values, active, (0, 0, 0), transform=transform)])
    density, colour = random(3, 3, 3), random(3, 3, 3, 3)
    box = Box((0, 0, 0), (3, 3, 3))
    write_painted(target, source, PLAIN, density=density, colour=colour, box=box)
    np.testing.assert_array_equal(read_smoke(target, PLAIN).density, density)
    with open_vdb(target) as file:
        assert file.grids["density"].value_type == ("double" if dtype is np.float64 else "float")
        assert file.grids["Cd"].value_type == "vec3s"


def paint(source: Path, form: SmokeFormat = PLAIN, *, refine: int = 1, density: float = 2) -> Path:
    """The source painted with an even density and grey."""
    volume = read_smoke(source, form).refined(refine)
    target = source.with_name("painted.vdb")
    write_painted(
        target, source, form, box=volume.box, refine=refine,
        density=np.full(volume.density.shape, density, np.float32),
        colour=np.full((*volume.density.shape, 3), 0.5, np.float32),
    )  # fmt: skip
    return target


@pytest.mark.parametrize("refine", [1, 2])
@pytest.mark.parametrize("half", [True, False])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32])
def test_a_colour_has_of_the_densitys_metadata_what_is_true_of_it(
    dtype: type, half: bool, refine: int, tmp_path: Path
) -> None:
    name_of_type = {np.float32: "float", np.float64: "double", np.int32: "int32"}[dtype]
    metadata = {
        "class": "fog volume", "is_local_space": False, "is_saved_as_half_float": half,
        "value_type": name_of_type, "grid_type": name_of_type, "vector_type": "invariant",
        "greatest": 0.7, "file_base_resolution": (8, 8, 8), "file_bbox_min": (-9, -9, -9),
    }  # fmt: skip
    values = np.ones((3, 4, 5), dtype)
    grid = Grid.from_dense(
        "density", values, values > 0, (0, 0, 0), transform=Transform.uniform(1), half=half,
        metadata=metadata,
    )  # fmt: skip
    write_vdb(tmp_path / "source.vdb", [grid])
    with open_vdb(paint(tmp_path / "source.vdb", refine=refine)) as file:
        density, colour = file.grids["density"].metadata, file.grids["Cd"].metadata
    sides = np.array([3, 4, 5]) * refine
    for of_grid, rim in ((density, 0), (colour, 1)):
        assert of_grid.value("file_bbox_min") == (-rim, -rim, -rim)
        assert of_grid.value("file_bbox_max") == tuple(sides - 1 + rim)
        assert of_grid.value("file_voxel_count") == np.prod(sides + 2 * rim)
        assert of_grid.value("class") == "fog volume"
        assert of_grid.value("is_local_space") is False
    statistics = {name for name in colour if name.startswith("file_")}
    own = {"class", "is_local_space", "name"} | ({"is_saved_as_half_float"} if half else set())
    assert set(colour) - statistics == own
    assert (density.value("name"), colour.value("name")) == ("density", "Cd")
    assert density.value("greatest") == 0.7
    # Whole numbers become float: what says otherwise goes.
    expected = None if dtype is np.int32 else name_of_type
    assert density.value("value_type") == density.value("grid_type") == expected
    # And what tells of the coarser cells.
    assert density.value("file_base_resolution") == ((8, 8, 8) if refine == 1 else None)


@pytest.mark.parametrize(
    ("dtype", "half", "background"),
    [(np.float32, False, 0.25), (np.float32, True, 0.25), (np.float64, False, -1.5),
     (np.int32, False, 3)],
)  # fmt: skip
@pytest.mark.parametrize("refine", [1, 2])
def test_a_painted_density_keeps_its_background_and_cells_without_density_stay_empty(
    dtype: type, half: bool, background: float, refine: int, tmp_path: Path
) -> None:
    values = np.arange(27).reshape(3, 3, 3).astype(dtype)  # the first is active and zero
    active = values != 13
    grid = Grid.from_dense(
        "density", values, active, (-1, 2, 3), transform=Transform.uniform(1), half=half,
        background=background,
    )  # fmt: skip
    write_vdb(tmp_path / "source.vdb", [grid])
    assert read_smoke(tmp_path / "source.vdb", PLAIN).density[1, 1, 1] == 0
    with open_vdb(paint(tmp_path / "source.vdb", refine=refine, density=0)) as file:
        density, colour = file.read("density"), file.read("Cd")
    assert density.tree.background == background
    np.testing.assert_array_equal(colour.tree.background, 0)
    box = Box((-1, 2, 3), (2, 5, 6)).refined(refine)
    painted, is_active = density.to_dense(box.grown(1))
    inside = box.slices(box.grown(1))
    finer = active.repeat(refine, 0).repeat(refine, 1).repeat(refine, 2)
    np.testing.assert_array_equal(is_active[inside], finer)
    assert is_active.sum() == finer.sum()
    np.testing.assert_array_equal(painted[is_active], 0)
    np.testing.assert_array_equal(painted[~is_active], background)


def test_a_file_without_grids_is_a_frame_without_smoke(tmp_path: Path) -> None:
    source = tmp_path / "source.vdb"
    write_vdb(source, [], metadata={"shot": "7b"})
    volume = read_smoke(source, PLAIN, frame=3)
    assert (volume.density.size, volume.velocity, volume.frame) == (0, None, 3)
    assert smoke_box(source, PLAIN).is_empty
    target = paint(source)
    with open_vdb(target) as file:
        assert file.names == ()
        assert file.metadata.value("shot") == "7b"
    colour = read_colour(target, PLAIN, grid="Cd", box=volume.box)
    assert colour is not None
    assert colour.shape == (0, 0, 0, 3)


def test_a_file_of_other_grids_is_no_frame_without_smoke(source: Path) -> None:
    form = SmokeFormat(density_grid="smoke")
    listed = (
        r"source\.vdb: no density grid 'smoke'; choose with `density_grid` from "
        r"heat \(float\), density \(float\)$"
    )
    for read in (read_smoke, smoke_box):
        with pytest.raises(GridError, match=listed):
            read(source, form)


def test_a_stream_is_painted_as_the_file_it_was(source: Path) -> None:
    painted = paint(source).read_bytes()
    data = source.read_bytes()
    source.write_bytes(data[:20] + b"\0" + data[21:])
    assert paint(source).read_bytes() == painted


def test_a_grid_that_cannot_be_read_passes_through_or_stops_the_painting(tmp_path: Path) -> None:
    source = tmp_path / "source.vdb"
    original = Path(__file__).parents[1] / "data" / "with_frustum.vdb"
    source.write_bytes(original.read_bytes())
    with open_vdb(source) as before, open_vdb(paint(source)) as after:
        assert after.names == ("density", "clouds", "vel", "Cd")
        old, new = before.grids["clouds"], after.grids["clouds"]
        assert (new.map_type, new.metadata) == (old.map_type, old.metadata)
        old_end, new_end = old.end or 0, new.end or 0
        length = old_end - old.transform_start
        assert (tmp_path / "painted.vdb").read_bytes()[
            new_end - length : new_end
        ] == source.read_bytes()[old_end - length : old_end]
    # As a stream, of a kind that nobody knows: where it ends cannot be told.
    data = bytearray(source.read_bytes().replace(b"NonlinearFrustumMap", b"NonlinearCarouselMp"))
    data[20] = 0
    source.write_bytes(data)
    (tmp_path / "painted.vdb").unlink()
    with pytest.raises(GridError, match=r"source\.vdb: grid 'clouds' is of type float behind a "):
        paint(source, SmokeFormat(velocity_grid="none"))
    assert [path.name for path in tmp_path.iterdir()] == ["source.vdb"]


def test_a_frame_without_smoke_passes_through(tmp_path: Path) -> None:
    source, target = tmp_path / "source.vdb", tmp_path / "painted.vdb"
    empty = Volume(np.zeros(SHAPE, np.float32), random(*SHAPE, 3), ORIGIN, np.eye(4), 3)
    write_smoke(source, empty)
    volume = read_smoke(source, PLAIN)
    assert volume.box.is_empty
    density, colour = painting(volume)
    write_painted(target, source, PLAIN, density=density, colour=colour, box=volume.box)
    with open_vdb(target) as file:
        assert file.names == ("density", "velocity", "Cd")
        assert file.read("Cd").active_voxels == 0


def test_what_does_not_fit_is_refused_and_leaves_no_file(source: Path, tmp_path: Path) -> None:
    volume = read_smoke(source, PLAIN)
    density, colour = painting(volume)
    target = tmp_path / "painted.vdb"
    smaller = Box(volume.box.lower, (4, 8, 13))
    with pytest.raises(ShapeError, match="do not fit"):
        write_painted(target, source, PLAIN, density=density, colour=colour, box=smaller)
    with pytest.raises(ShapeError, match=r"source\.vdb: .* smoke in .* was painted"):
        write_painted(target, source, PLAIN, density=density[:-1], colour=colour[:-1], box=smaller)
    for names in (("density",), ("Cd", "Cd")):
        with pytest.raises(OptionError, match="colour_grids: expected names of their own"):
            write_painted(
                target,
                source,
                PLAIN,
                density=density,
                colour=colour,
                box=volume.box,
                colour_grids=names,
            )
    with pytest.raises(OutputError, match=r"smoke is written as \.vdb, not \.npz"):
        write_painted(
            tmp_path / "a.npz", source, PLAIN, density=density, colour=colour, box=volume.box
        )
    assert [file.name for file in tmp_path.iterdir()] == ["source.vdb"]


def test_mantaflow_frames_become_vdb_files_with_their_velocity(tmp_path: Path) -> None:
    density = np.zeros((6, 7, 8), np.float32)  # z, y, x
    density[1:5, 2:6, 3:7] = random(4, 4, 4)
    density[2, 3, 4] = 0
    for name, array in (("d", density), ("v", random(6, 7, 8, 3, seed=9))):
        (tmp_path / name).mkdir()
        np.savez_compressed(tmp_path / name / "001.npz", x=array)
    source = tmp_path / "d" / "001.npz"
    volume = read_smoke(source, PLAIN)
    painted_density, colour = painting(volume)
    target = tmp_path / "painted.vdb"
    write_painted(target, source, PLAIN, density=painted_density, colour=colour, box=volume.box)
    y_up = SmokeFormat(up_axis="y")
    painted = read_smoke(target, y_up)
    assert painted.box == volume.box
    np.testing.assert_array_equal(painted.density, painted_density)
    np.testing.assert_array_equal(painted.velocity, volume.velocity)
    with open_vdb(target) as file:
        assert file.names == ("density", "Cd", "velocity")
        smoke = file.read("density")
        assert smoke.active_voxels == 63
        active = smoke.to_dense(smoke.active_box().grown(1))[1]
        with_rim = binary_dilation(active, np.ones((3, 3, 3))).sum()
        assert file.read("Cd").active_voxels == with_rim
        assert file.grids["velocity"].grid_class == "staggered"
    fine = volume.refined(3)
    write_painted(
        target,
        source,
        PLAIN,
        density=fine.density,
        colour=painting(fine)[1],
        box=fine.box,
        refine=3,
    )
    finer = read_smoke(target, replace(y_up, velocity_grid="none"))
    assert finer.box == fine.box
    np.testing.assert_array_equal(finer.density, fine.density)
    np.testing.assert_allclose(finer.index_to_world, fine.index_to_world)
    with open_vdb(target) as file:
        assert file.grids["velocity"].transform.voxel_size == (1, 1, 1)


def test_a_simulated_volume_is_read_back_by_default_options(tmp_path: Path) -> None:
    density = np.where(random(*SHAPE) > 0.7, random(*SHAPE, seed=1), 0).astype(np.float32)
    density[0, 0, 0] = density[-1, -1, -1] = 0.5
    matrix = np.diag([0.1, 0.1, 0.1, 1.0])
    volume = Volume(density, random(*SHAPE, 3, seed=2) - 0.5, ORIGIN, matrix, 4)
    write_smoke(tmp_path / "s.vdb", volume)
    again = read_smoke(tmp_path / "s.vdb", PLAIN, frame=4)
    np.testing.assert_array_equal(again.density, density)
    assert volume.velocity is not None
    assert again.velocity is not None
    np.testing.assert_array_equal(again.velocity[density > 0], volume.velocity[density > 0])
    np.testing.assert_array_equal(again.index_to_world, matrix)
    assert (again.origin, again.frame) == (ORIGIN, 4)
    with open_vdb(tmp_path / "s.vdb") as file:
        assert file.grids["velocity"].metadata.value("velocity_units") == "cells/frame"
        assert file.grids["density"].grid_class == "fog volume"
    write_smoke(tmp_path / "still.vdb", replace(volume, velocity=None))
    assert read_smoke(tmp_path / "still.vdb", PLAIN).velocity is None
    with pytest.raises(OutputError, match="without suffix"):
        write_smoke(tmp_path / "s", volume)


BLENDER = SmokeFormat(velocity_units="mantaflow", fps=24, time_scale=0.4)


@needs_cache
def test_blender_caches_are_painted_without_loss(tmp_path: Path) -> None:
    path = find_frames(CACHE, "45")[0].path
    volume = read_smoke(path, BLENDER, frame=45)
    assert volume.box == Box((3, 1, 2), (63, 62, 77))
    assert volume.velocity is not None
    assert 3 < np.abs(volume.velocity).max() < 6
    density, colour = painting(volume)
    target = tmp_path / "painted.vdb"
    write_painted(target, path, BLENDER, density=density, colour=colour, box=volume.box)
    painted = read_smoke(target, BLENDER, frame=45)
    # Halves doubled are halves.
    np.testing.assert_array_equal(painted.density, density)
    np.testing.assert_array_equal(painted.velocity, volume.velocity)
    with open_vdb(path) as before, open_vdb(target) as after:
        assert after.names == (*before.names, "Cd")
        for name in before.names:
            assert after.grids[name].transform == before.grids[name].transform
            assert after.grids[name].metadata.value("file_base_resolution") == (64, 64, 96)
            assert after.read(name).active_voxels == before.read(name).active_voxels


@needs_cache
def test_blender_velocity_is_a_fifth_too_fast() -> None:
    fitted = with_fitted_scale(
        replace(BLENDER, velocity_scale="fit"), find_frames(CACHE, "33,34,45,46")
    )
    assert isinstance(fitted.velocity_scale, float)
    assert 0.77 < fitted.velocity_scale < 0.87
