"""What a file says ahead of its values: versions, names, metadata, transforms, boxes."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.errors import FileFormatError, GridError, OptionError
from vnca.io.vdb import Entry, Grid, Metadata, Transform, open_vdb, write_vdb

Builder = Callable[..., Grid]


def test_a_real_cache_lists_what_it_holds(real_frame: Path) -> None:
    with open_vdb(real_frame) as file:
        assert file.names == ("velocity", "density", "shadow", "temperature", "flame")
        velocity, flame = file.grids["velocity"], file.grids["flame"]
        assert (velocity.value_type, velocity.grid_class) == ("vec3s", "staggered")
        assert velocity.is_half
        assert velocity.box == ((13, 12, 2), (53, 52, 54))
        assert velocity.metadata.value("file_base_resolution") == (64, 64, 96)
        np.testing.assert_allclose(velocity.transform.voxel_size, 0.01875, rtol=1e-6)
        assert flame.box is not None
        assert flame.box.is_empty
        assert file.read("flame").active_box().is_empty
        # Tiles, and velocity only where there is density.
        assert file.read("shadow").active_box().shape == (64, 64, 96)
        assert file.read("velocity").active_voxels == 30974


def test_a_missing_grid_is_named_beside_those_there_are(real_frame: Path) -> None:
    with (
        open_vdb(real_frame) as file,
        pytest.raises(GridError, match=r"'smoke'.*density \(float\), shadow"),
    ):
        file.read("smoke")


def test_values_are_read_only_while_the_file_is_open(real_frame: Path) -> None:
    with open_vdb(real_frame) as file:
        pass
    assert file.grids["density"].metadata
    with pytest.raises(GridError, match="has been closed"):
        file.read("density")


@pytest.mark.parametrize("version", [222, 223, 224, 225])
def test_every_current_version_reads_alike(version: int, real_frame: Path, tmp_path: Path) -> None:
    data = bytearray(real_frame.read_bytes())
    struct.pack_into("<I", data, 8, version)
    (tmp_path / "a.vdb").write_bytes(data)
    with open_vdb(tmp_path / "a.vdb") as file, open_vdb(real_frame) as original:
        got, expected = file.read("density").tree, original.read("density").tree
        np.testing.assert_array_equal(got.leaf_values, expected.leaf_values)
        write_vdb(tmp_path / "copy.vdb", list(file.grids.values()))
    with open_vdb(tmp_path / "copy.vdb") as file:
        np.testing.assert_array_equal(file.read("density").tree.leaf_values, got.leaf_values)


@pytest.mark.parametrize(
    ("offset", "layout", "value", "words"),
    [
        (0, "q", 7, "not a VDB file"),
        (8, "I", 221, "version 221 are not supported, only 222 to 225"),
        (8, "I", 226, "version 226 are not supported"),
    ],
)
def test_other_kinds_of_file_are_refused_by_name(
    offset: int, layout: str, value: int, words: str, real_frame: Path, tmp_path: Path
) -> None:
    data = bytearray(real_frame.read_bytes())
    struct.pack_into(f"<{layout}", data, offset, value)
    (tmp_path / "a.vdb").write_bytes(data)
    with pytest.raises(FileFormatError, match=rf"a\.vdb.*{words}"):
        open_vdb(tmp_path / "a.vdb")


@pytest.mark.parametrize("version", [223, 224])
def test_unknown_types_are_listed_refused_and_copied_where_the_layout_is_sure(
    version: int, random_grid: Builder, tmp_path: Path
) -> None:
    write_vdb(tmp_path / "a.vdb", [random_grid("float")])
    data = (tmp_path / "a.vdb").read_bytes().replace(b"Tree_float_5_4_3", b"Tree_quats_5_4_3")
    (tmp_path / "a.vdb").write_bytes(data[:8] + struct.pack("<I", version) + data[12:])
    with open_vdb(tmp_path / "a.vdb") as file:
        assert file.grids["float"].value_type == "quats"
        with pytest.raises(FileFormatError, match="cannot read values of type quats"):
            file.read("float")
        if version < 224:
            with pytest.raises(GridError, match="copied only from files of version 224"):
                write_vdb(tmp_path / "b.vdb", list(file.grids.values()))
        else:
            write_vdb(tmp_path / "b.vdb", list(file.grids.values()))
            assert b"Tree_quats_5_4_3" in (tmp_path / "b.vdb").read_bytes()


def test_other_tree_shapes_are_refused_by_name(random_grid: Builder, tmp_path: Path) -> None:
    write_vdb(tmp_path / "a.vdb", [random_grid("float")])
    data = (tmp_path / "a.vdb").read_bytes().replace(b"Tree_float_5_4_3", b"Tree_float_4_4_3")
    (tmp_path / "a.vdb").write_bytes(data)
    with open_vdb(tmp_path / "a.vdb") as file, pytest.raises(FileFormatError, match="float_4_4_3"):
        file.read("float")


def test_a_box_without_metadata_is_unknown(random_grid: Builder, tmp_path: Path) -> None:
    write_vdb(tmp_path / "a.vdb", [random_grid("float")])
    data = (tmp_path / "a.vdb").read_bytes().replace(b"file_bbox_min", b"file_bbox_xxx")
    (tmp_path / "a.vdb").write_bytes(data)
    with open_vdb(tmp_path / "a.vdb") as file:
        assert file.grids["float"].box is None


def test_metadata_of_every_type_arrives_as_it_left(random_grid: Builder, tmp_path: Path) -> None:
    values: dict[str, Any] = {
        "text": "größer", "yes": True, "count": -3, "many": 2**40, "ratio": 0.1,
        "cell": (1, 2, 3), "point": (0.5, 1, 2), "pair": (1, 2), "empty": "",
        "single": Entry.of(0.1, "float"), "matrix": Entry.of(tuple(range(16)), "mat4d"),
        "unheard of": Entry("strange", b"\x00\xff\x01"), "odd bytes": Entry("string", b"\xff\xfe"),
    }  # fmt: skip
    grid = random_grid("float")
    grid.metadata.update(Metadata.of(values))
    write_vdb(tmp_path / "a.vdb", [grid], metadata=values)
    with open_vdb(tmp_path / "a.vdb") as file:
        write_vdb(tmp_path / "b.vdb", list(file.grids.values()), file.metadata)
        for metadata in (file.metadata, file.grids["float"].metadata):
            for name, value in Metadata.of(values).items():
                assert metadata[name] == value
        assert file.metadata.value("text") == "größer"
        assert file.metadata.value("many") == 2**40
        assert file.metadata.value("point") == (0.5, 1, 2)
        assert file.metadata.value("unheard of") == b"\x00\xff\x01"
        assert file.metadata.value("odd bytes") == r"\xff\xfe"
        assert file.metadata.value("single") == float(np.float32(0.1))
    assert (tmp_path / "a.vdb").read_bytes() == (tmp_path / "b.vdb").read_bytes()


@pytest.mark.parametrize("value", [None, (1,), object(), 2**70])
def test_metadata_without_a_type_is_refused(value: Any) -> None:
    with pytest.raises(OptionError, match="metadata"):
        Metadata.of({"x": value})


@pytest.mark.parametrize(
    ("matrix", "map_type"),
    [
        (np.diag([0.5, 0.5, 0.5, 1]), "UniformScaleMap"),
        (np.diag([0.5, -0.5, 2, 1]), "ScaleMap"),
        ([[2, 0, 0, 1], [0, 2, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]], "UniformScaleTranslateMap"),
        ([[2, 0, 0, 1], [0, 3, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]], "ScaleTranslateMap"),
        ([[0, 2, 0, 1], [-2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]], "AffineMap"),
    ],
)
def test_a_matrix_becomes_the_simplest_map_and_comes_back(matrix: Any, map_type: str) -> None:
    transform = Transform.from_matrix(np.array(matrix))
    assert transform.map_type == map_type
    np.testing.assert_array_equal(transform.index_to_world, matrix)


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((4, 4)), np.diag([1, 1, 0, 1]), np.eye(4) * np.nan, np.eye(3), 2 * np.eye(4)],
)
def test_a_matrix_that_is_no_transform_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(GridError, match="affine, invertible"):
        Transform.from_matrix(matrix)
