"""Written files: the same bytes each time, whole or not at all, one error a mistake."""

import hashlib
import struct
import threading
from collections.abc import Callable
from pathlib import Path

import blosc
import numpy as np
import pytest

from vnca.core.errors import GridError, OptionError
from vnca.io.vdb import Grid, Metadata, Tiles, Transform, open_vdb, write_vdb

Builder = Callable[..., Grid]


@pytest.mark.parametrize("compression", ["blosc", "zip", "none"])
def test_the_same_grids_make_the_same_file(
    compression: str, tiled_grid: Builder, random_grid: Builder, tmp_path: Path
) -> None:
    # Enough tiles that a node is packed in several blocks.
    many = random_grid("vec3d", name="many")
    k = np.arange(20000)
    origins = np.stack([4096 + (k >> 10) * 128, (k >> 5 & 31) * 128, (k & 31) * 128], axis=1)
    values = np.random.default_rng(0).integers(0, 9, (20000, 3)).astype(np.float64)
    tiles = Tiles(
        origins.astype(np.int32), np.full(20000, 128, np.int32), values, np.ones(20000, bool)
    )
    many.tree = many.tree._replace(tiles=tiles)
    digests = set()
    for threads in (1, 2, 2):
        before = blosc.set_nthreads(threads)
        write_vdb(tmp_path / "a.vdb", [tiled_grid("float"), many], compression=compression)
        assert blosc.set_nthreads(before) == threads
        digests.add(hashlib.sha256((tmp_path / "a.vdb").read_bytes()).digest())
    assert len(digests) == 1
    with open_vdb(tmp_path / "a.vdb") as file:
        np.testing.assert_array_equal(file.read("many").tree.tiles.values, values)


def test_different_grids_make_files_of_different_identity(
    random_grid: Builder, tmp_path: Path
) -> None:
    identities = set()
    for seed in (0, 1):
        write_vdb(tmp_path / "a.vdb", [random_grid("float", seed=seed)])
        identities.add((tmp_path / "a.vdb").read_bytes()[21:57])
    assert len(identities) == 2


@pytest.mark.parametrize(
    "value_type", ["float", "half", "double", "int32", "int64", "bool", "vec3d"]
)
@pytest.mark.parametrize("compression", ["blosc", "zip", "none"])
def test_values_come_back_bit_for_bit(
    value_type: str, compression: str, tiled_grid: Builder, tmp_path: Path
) -> None:
    background = True if value_type == "bool" else 3
    grid = tiled_grid(value_type, background=background)
    write_vdb(tmp_path / "a.vdb", [grid], compression=compression)
    with open_vdb(tmp_path / "a.vdb") as file:
        (header,) = file.grids.values()
        got = header.read()
    assert header.box == grid.active_box() == got.active_box()
    box = grid.tree.leaf_origins.min(0), grid.tree.leaf_origins.max(0) + 8
    box = type(grid.active_box())(*(tuple(corner.tolist()) for corner in box))
    for mine, theirs in zip(got.to_dense(box), grid.to_dense(box), strict=True):
        assert mine.dtype == theirs.dtype
        np.testing.assert_array_equal(mine, theirs)
    assert got.active_voxels == grid.active_voxels


@pytest.mark.parametrize("value_type", ["float", "vec3d"])
def test_a_background_that_is_no_number_is_omitted_as_any_other(
    value_type: str, random_grid: Builder, tmp_path: Path
) -> None:
    sizes = []
    for background in (0, np.nan):
        write_vdb(tmp_path / "a.vdb", [random_grid(value_type, background=background)])
        sizes.append((tmp_path / "a.vdb").stat().st_size)
        with open_vdb(tmp_path / "a.vdb") as file:
            tree = file.read(value_type).tree
        assert len(tree.tiles.origins) == 0
        np.testing.assert_array_equal(np.unique(tree.leaf_values[~tree.leaf_active]), background)
    assert sizes[0] == sizes[1]


def test_only_files_with_a_half_grid_are_of_a_version_that_knows_it(
    random_grid: Builder, tmp_path: Path
) -> None:
    for value_type, version in (("float", 224), ("half", 225)):
        write_vdb(tmp_path / "a.vdb", [random_grid(value_type)])
        assert struct.unpack_from("<I", (tmp_path / "a.vdb").read_bytes(), 8) == (version,)


def test_encoded_and_copied_grids_share_a_file_and_a_name(real_frame: Path, tmp_path: Path) -> None:
    with open_vdb(real_frame) as file:
        density = file.read("density")
        write_vdb(tmp_path / "a.vdb", [file.grids["density"], density, file.grids["velocity"]])
    with open_vdb(tmp_path / "a.vdb") as file:
        assert file.names == ("density[0]", "density[1]", "velocity")
        copied, encoded = file.read("density[0]"), file.read("density[1]")
        assert copied.name == encoded.name == "density"
        box = density.active_box()
        for one, other in zip(copied.to_dense(box), encoded.to_dense(box), strict=True):
            np.testing.assert_array_equal(one, other)
        assert encoded.metadata.value("file_compression") == "blosc + active values"
        assert encoded.metadata.value("file_base_resolution") == (64, 64, 96)


def test_a_file_can_be_rewritten_in_place(real_frame: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    path.write_bytes(real_frame.read_bytes())
    with open_vdb(path) as file:
        write_vdb(path, [file.grids["flame"], file.read("density")])
    with open_vdb(path) as file:
        assert file.names == ("flame", "density")


def test_an_index_for_delayed_loading_of_doubtful_age_is_not_copied(
    written_by_openvdb: Path, tmp_path: Path
) -> None:
    data = bytearray((written_by_openvdb / "float.vdb").read_bytes())
    for library, kept in (((6, 1), False), ((6, 2), True), ((10, 0), True)):
        struct.pack_into("<II", data, 12, *library)
        (tmp_path / "old.vdb").write_bytes(data)
        with open_vdb(tmp_path / "old.vdb") as file:
            assert "file_delayed_load" in file.grids["float"].metadata
            write_vdb(tmp_path / "copy.vdb", list(file.grids.values()))
            write_vdb(tmp_path / "encoded.vdb", [file.read("float")])
        with open_vdb(tmp_path / "copy.vdb") as file:
            assert ("file_delayed_load" in file.grids["float"].metadata) == kept
        with open_vdb(tmp_path / "encoded.vdb") as file:
            assert "file_delayed_load" not in file.grids["float"].metadata


def test_two_threads_may_write_at_once(tiled_grid: Builder, tmp_path: Path) -> None:
    threads = [
        threading.Thread(target=write_vdb, args=(tmp_path / f"{n}.vdb", [tiled_grid("vec3s")]))
        for n in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (tmp_path / "0.vdb").read_bytes() == (tmp_path / "1.vdb").read_bytes()


def test_values_too_large_for_half_floats_are_refused_and_nothing_is_written(
    tmp_path: Path,
) -> None:
    values = np.array([[[1, 70000, np.inf, np.nan]]], np.float32)
    grid = Grid.from_dense(
        "Cd", values, np.ones((1, 1, 4), bool), (0, 0, 0), transform=Transform.uniform(1), half=True
    )
    with pytest.raises(GridError, match="'Cd': values up to 70000 do not fit half floats"):
        write_vdb(tmp_path / "a.vdb", [grid])
    assert list(tmp_path.iterdir()) == []


def tile(origin: tuple[int, int, int], edge: int) -> Tiles:
    return Tiles(
        np.array([origin], np.int32), np.array([edge], np.int32), np.ones(1, "f4"), np.ones(1, bool)
    )


@pytest.mark.parametrize(
    ("tiles", "words"),
    [
        (tile((3, 0, 0), 8), "multiple of its width"),
        (tile((0, 0, 0), 16), "8, 128 or 4096"),
        (tile((0, 120, 0), 8), "share a place"),
        (tile((0, 0, 0), 128), "a tile lies where leaves are"),
        (tile((0, 0, 0), 4096), "a tile lies where leaves or smaller tiles are"),
    ],
)
def test_trees_that_contradict_themselves_are_refused(
    tiles: Tiles, words: str, random_grid: Builder, tmp_path: Path
) -> None:
    grid = random_grid("float")
    grid.tree = grid.tree._replace(tiles=tiles)
    with pytest.raises(GridError, match=f"'float'.*{words}"):
        write_vdb(tmp_path / "a.vdb", [grid])


def test_unknown_compression_and_impossible_names_are_refused(
    random_grid: Builder, tmp_path: Path
) -> None:
    with pytest.raises(OptionError, match="none, zip, blosc, got 'lzma'"):
        write_vdb(tmp_path / "a.vdb", [], compression="lzma")
    with pytest.raises(GridError, match="cannot hold"):
        write_vdb(tmp_path / "a.vdb", [random_grid("float", name="a\x1e1")])


def test_metadata_handed_over_is_not_changed(random_grid: Builder, tmp_path: Path) -> None:
    grid = random_grid("float")
    grid.metadata = Metadata.of({"file_voxel_count": 1})
    write_vdb(tmp_path / "a.vdb", [grid])
    assert grid.metadata == Metadata.of({"file_voxel_count": 1})
