"""OpenVDB and this reader and writer understand each other's files."""

import ast
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.errors import GridError
from vnca.io import SmokeFormat, read_smoke
from vnca.io import vdb as write
from vnca.io.provenance import Provenance
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb
from vnca.io.vdb.compression import Codec
from vnca.io.vdb.layout import Compression, NodeCode

Judge = Callable[[list[Path]], list[list[dict[str, Any]]]]
Agreement = Callable[[Grid, dict[str, Any]], None]
Builder = Callable[..., Grid]

VARIANTS = (
    "float", "vec3s", "bool", "bool_true", "half_FloatGrid", "half_Vec3SGrid", "tiles",
    "root_tiles", "omitted", "level_set", "empty", "transforms", "several",
)  # fmt: skip


def grids_by_name(path: Path) -> list[Grid]:
    """In the order of the judge."""
    with open_vdb(path) as file:
        headers = sorted(file.grids.values(), key=lambda header: header.grid_name)
        return [file.read(header.name) for header in headers]


def agree_on(paths: list[Path], judge: Judge, assert_agrees: Agreement) -> None:
    for path, judged in zip(paths, judge(paths), strict=True):
        for grid, expected in zip(grids_by_name(path), judged, strict=True):
            assert_agrees(grid, expected)


def test_every_kind_of_file_from_openvdb_reads_as_there(
    written_by_openvdb: Path, judge: Judge, assert_agrees: Agreement
) -> None:
    agree_on([written_by_openvdb / f"{name}.vdb" for name in VARIANTS], judge, assert_agrees)


def test_all_ways_of_omitting_inactive_values_were_met(
    written_by_openvdb: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    met: dict[int, set[int]] = {}
    original = Codec._read_inactive_values

    def spy(codec: Codec, cursor: Any, code: int, cells: int) -> Any:
        met.setdefault(cells, set()).add(code)
        return original(codec, cursor, code, cells)

    monkeypatch.setattr(Codec, "_read_inactive_values", spy)
    grids_by_name(written_by_openvdb / "omitted.vdb")
    ways = set(NodeCode) - {NodeCode.BACKGROUND, NodeCode.ALL_VALUES}
    assert met == {512: ways, 16**3: ways, 32**3: ways}


@pytest.mark.parametrize("name", ["tiles", "root_tiles", "omitted", "level_set"])
def test_inactive_values_and_tiles_survive_writing(
    name: str, written_by_openvdb: Path, judge: Judge, assert_agrees: Agreement, tmp_path: Path
) -> None:
    grids = grids_by_name(written_by_openvdb / f"{name}.vdb")
    write_vdb(tmp_path / "again.vdb", grids)
    for grid, expected in zip(grids, judge([tmp_path / "again.vdb"])[0], strict=True):
        assert_agrees(grid, expected)


@pytest.mark.parametrize("codec", ["none", "zip", "blosc", "active"])
def test_every_compression_of_openvdb_is_read(
    codec: str, written_by_openvdb: Path, vdb_tool: Callable[..., None], tmp_path: Path
) -> None:
    for name in ("vec3s", "float", "tiles"):
        rewritten = tmp_path / f"{name}.vdb"
        vdb_tool(written_by_openvdb / f"{name}.vdb", rewritten, f"codec={codec}")
        (expected,), (grid,) = (
            grids_by_name(path) for path in (written_by_openvdb / f"{name}.vdb", rewritten)
        )
        assert_same_tree(grid, expected)


def assert_same_tree(grid: Grid, expected: Grid) -> None:
    def content(part: Grid) -> list[Any]:
        order = np.lexsort(part.tree.leaf_origins.T)
        tile_order = np.lexsort(part.tree.tiles.origins.T)
        leaves = (part.tree.leaf_origins, part.tree.leaf_active, part.tree.leaf_values)
        return [
            part.tree.background,
            *(array[order] for array in leaves),
            *(array[tile_order] for array in part.tree.tiles),
        ]

    for got, wanted in zip(content(grid), content(expected), strict=True):
        assert got.dtype == wanted.dtype
        np.testing.assert_array_equal(got, wanted)
    assert grid.value_type == expected.value_type
    assert grid.transform == expected.transform


def test_files_written_here_read_the_same_in_openvdb(
    tiled_grid: Builder, judge: Judge, assert_agrees: Agreement, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    grids = [
        tiled_grid("float", background=2),
        tiled_grid("vec3s", background=(1, 2, 3)),
        tiled_grid("bool"),
        tiled_grid("float", name="half", half=True, seed=1),
        tiled_grid("vec3s", name="half vector", half=True, seed=2),
        Grid.from_dense(
            "nothing", np.zeros((4, 4, 4), np.float32), np.zeros((4, 4, 4), bool), (0, 0, 0),
            transform=Transform.from_matrix(np.array(
                [[1, 2, 0, 4], [0, 1, 0.5, 5], [0.25, 0, 2, 6], [0, 0, 0, 1.0]]
            )),
        ),
    ]  # fmt: skip
    # Also without omitting inactive values, as Blender does.
    ways = {
        "blosc": None, "zip": None, "none": None, "blosc, all": Compression.BLOSC,
        "zip, all": Compression.ZIP, "none, all": Compression(0),
    }  # fmt: skip
    paths = []
    for way, flags in ways.items():
        if flags is not None:
            monkeypatch.setitem(write._FLAGS, way, flags)
        paths.append(tmp_path / f"{way}.vdb")
        write_vdb(paths[-1], grids, compression=way)
    agree_on(paths, judge, assert_agrees)
    for path in paths:
        for grid, written in zip(
            grids_by_name(path), sorted(grids, key=lambda grid: grid.name), strict=True
        ):
            if not grid.is_half:
                assert_same_tree(grid, written)


def test_statistics_are_those_openvdb_would_write(
    tiled_grid: Builder, judge: Judge, tmp_path: Path
) -> None:
    write_vdb(tmp_path / "a.vdb", [tiled_grid("float"), tiled_grid("vec3s"), tiled_grid("bool")])
    for judged in judge([tmp_path / "a.vdb"])[0]:
        metadata = judged["metadata"]
        assert metadata["file_mem_bytes"] == judged["memory"]
        assert metadata["file_voxel_count"] == judged["active_voxels"]
        assert metadata["file_bbox_min"] == judged["bounds"][0]
        assert metadata["file_bbox_max"] == [end - 1 for end in judged["bounds"][1]]
        assert metadata["file_compression"] == "blosc + active values"


@pytest.mark.parametrize("codec", ["none", "zip", "blosc", "active"])
def test_number_types_survive_a_passage_through_openvdb(
    codec: str, tiled_grid: Builder, vdb_tool: Callable[..., None], tmp_path: Path
) -> None:
    grids = [
        tiled_grid(value_type, name=value_type, background=background)
        for value_type, background in (
            ("double", 0.1), ("int32", -7), ("int64", 2**40), ("vec3i", 3), ("vec3d", (1, 2, 0.1)),
        )
    ]  # fmt: skip
    write_vdb(tmp_path / "here.vdb", grids)
    vdb_tool(tmp_path / "here.vdb", tmp_path / "there.vdb", f"codec={codec}")
    for grid, expected in zip(
        grids_by_name(tmp_path / "there.vdb"), grids_by_name(tmp_path / "here.vdb"), strict=True
    ):
        assert_same_tree(grid, expected)
        for statistic in ("file_mem_bytes", "file_voxel_count", "file_bbox_min", "file_bbox_max"):
            assert grid.metadata[statistic] == expected.metadata[statistic]


def test_vectors_and_doubles_stored_as_half_floats_round_as_in_openvdb(
    random_grid: Builder, vdb_tool: Callable[..., None], tmp_path: Path
) -> None:
    names = ("double", "float", "vec3d", "vec3s")
    write_vdb(tmp_path / "full.vdb", [random_grid(name) for name in names])
    vdb_tool(tmp_path / "full.vdb", tmp_path / "there.vdb", "bits=16", "codec=zip")
    write_vdb(tmp_path / "here.vdb", [random_grid(name, half=True) for name in names])
    for grid, expected in zip(
        grids_by_name(tmp_path / "here.vdb"), grids_by_name(tmp_path / "there.vdb"), strict=True
    ):
        assert grid.is_half
        assert expected.is_half
        assert_same_tree(grid, expected)


def test_copied_grids_arrive_unchanged_and_openvdb_reads_them(
    written_by_openvdb: Path, judge: Judge, tmp_path: Path
) -> None:
    names = [*VARIANTS, "frustum"]
    for name in names:
        with open_vdb(written_by_openvdb / f"{name}.vdb") as file:
            write_vdb(tmp_path / f"{name}.vdb", list(file.grids.values()), file.metadata)
    before = judge([written_by_openvdb / f"{name}.vdb" for name in names])
    after = judge([tmp_path / f"{name}.vdb" for name in names])
    for old_file, new_file in zip(before, after, strict=True):
        for old, new in zip(old_file, new_file, strict=True):
            assert old.keys() == new.keys()
            for key, value in old.items():
                np.testing.assert_array_equal(new[key], value)
    for name in VARIANTS:
        if name != "several":  # whose shared tree became two
            for unique in ("a", "b"):
                with open_vdb(tmp_path / f"{name}.vdb") as file:
                    write_vdb(tmp_path / f"{unique}.vdb", list(file.grids.values()), file.metadata)
            assert (tmp_path / "a.vdb").read_bytes() == (tmp_path / f"{name}.vdb").read_bytes()


def test_a_copy_is_the_file_of_openvdb_but_for_its_header(
    written_by_openvdb: Path, tmp_path: Path
) -> None:
    for name in ("float", "transforms", "frustum", "omitted"):
        original = written_by_openvdb / f"{name}.vdb"
        with open_vdb(original) as file:
            write_vdb(tmp_path / "copy.vdb", list(file.grids.values()), file.metadata)
        behind_identifier = 8 + 12 + 1 + 36
        copy = (tmp_path / "copy.vdb").read_bytes()
        assert copy[behind_identifier:] == original.read_bytes()[behind_identifier:]


def test_grids_of_one_name_have_numbers_and_shared_trees_are_followed(
    written_by_openvdb: Path,
) -> None:
    with open_vdb(written_by_openvdb / "several.vdb") as file:
        assert file.names == ("density[0]", "density[1]", "[0]", "shared", "sharing")
        assert file.header("density").name == "density[0]"
        assert file.read("density[1]").value_type == "vec3s"
        shared, sharing = file.read("shared"), file.read("sharing")
        assert file.grids["sharing"].box == file.grids["shared"].box == shared.active_box()
        np.testing.assert_array_equal(shared.tree.leaf_values, sharing.tree.leaf_values)
        assert sharing.transform.voxel_size == (1, 2, 3)
        assert {name: entry.value for name, entry in file.metadata.items()} == {
            "title": "Übung", "count": 7, "scale": 0.5, "where": (1, 2, 3),
        }  # fmt: skip


def test_every_linear_map_of_openvdb_is_written_as_it_was_or_alike(
    written_by_openvdb: Path,
) -> None:
    with open_vdb(written_by_openvdb / "transforms.vdb") as file:
        kinds = {header.map_type for header in file.grids.values()}
        assert kinds >= {"UniformScaleMap", "ScaleMap", "ScaleTranslateMap", "AffineMap"}
        for header in file.grids.values():
            if header.map_type != "UnitaryMap":
                remade = Transform.from_matrix(header.transform.index_to_world)
                assert remade.encode() == header.transform.encode()


def test_a_frustum_is_listed_but_not_read(written_by_openvdb: Path) -> None:
    with open_vdb(written_by_openvdb / "frustum.vdb") as file:
        assert file.names == ("frustum", "density")
        assert file.read("density").active_voxels > 0
        with pytest.raises(GridError, match=r"'frustum' has a NonlinearFrustumMap; only linear"):
            file.read("frustum")


def test_three_frames_of_a_real_cache_are_bit_identical_to_openvdb(
    shared_smoke: list[Path], judge: Judge, assert_agrees: Agreement
) -> None:
    agree_on([shared_smoke[0], shared_smoke[11], shared_smoke[-1]], judge, assert_agrees)


@pytest.mark.slow
def test_all_frames_of_a_real_cache_are_bit_identical_to_openvdb(
    shared_smoke: list[Path], judge: Judge, assert_agrees: Agreement
) -> None:
    agree_on(shared_smoke, judge, assert_agrees)


def test_the_frame_kept_with_the_tests_is_bit_identical_to_openvdb(
    real_frame: Path, judge: Judge, assert_agrees: Agreement, tmp_path: Path
) -> None:
    write_vdb(tmp_path / "again.vdb", grids_by_name(real_frame))
    agree_on([real_frame, tmp_path / "again.vdb"], judge, assert_agrees)


def test_velocity_in_a_frustum_is_named_with_the_way_out(written_by_openvdb: Path) -> None:
    path = written_by_openvdb / "wind_bent.vdb"
    with pytest.raises(GridError, match=r"grid 'vel' has a Non.*FrustumMap.* `velocity_grid` none"):
        read_smoke(path, SmokeFormat())
    assert read_smoke(path, SmokeFormat(velocity_grid="none")).velocity is None


@pytest.mark.parametrize("name", ["wind", "wind_parts"])
def test_a_wind_in_large_turned_cells_of_openvdb_is_read_in_those_of_the_smoke(
    name: str, written_by_openvdb: Path
) -> None:
    """OpenVDB says where its cells lie; there, the wind is the place itself."""
    smoke = read_smoke(written_by_openvdb / f"{name}.vdb", SmokeFormat(velocity_units="m/s", fps=1))
    assert smoke.voxel_size == pytest.approx((0.1, 0.1, 0.1))
    places = 0.1 * np.stack(np.indices(smoke.density.shape), axis=-1)
    np.testing.assert_allclose(smoke.velocity, places / 0.1, atol=1e-4)  # type: ignore[arg-type]


def test_openvdb_reads_what_a_painting_tells_of_itself(openvdb_python: str, tmp_path: Path) -> None:
    told = Provenance(2.5, 0.75, "z", {"model": "night", "refine": 2, "strength": 0.5})
    values = np.ones((2, 2, 2), np.float32)
    path = tmp_path / "painted.vdb"
    grid = Grid.from_dense(
        "density", values, values > 0, (0, 0, 0), transform=Transform.uniform(0.1)
    )
    write_vdb(path, [grid], metadata=told.metadata)
    script = "import pyopenvdb, sys; print(sorted(pyopenvdb.readAll(sys.argv[1])[1].items()))"
    command = [openvdb_python, "-c", script, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    seen = dict(ast.literal_eval(done.stdout))
    assert seen.items() >= {
        "vnca_extinction": 2.5, "vnca_gamma": 0.75, "vnca_up_axis": "z", "vnca_model": "night",
        "vnca_refine": 2, "vnca_strength": 0.5,
    }.items()  # fmt: skip
