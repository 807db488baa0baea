"""GLB files that others wrote, compressed by Draco too, and those written back."""

import base64
import json
import struct
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pygltflib
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core.errors import BackendUnavailableError, FileFormatError, VncaError
from vnca.io.mesh import EXTENSION, read_mesh
from vnca.io.mesh.glb import Glb

NAME = Path("some.glb")
NUMBERS = np.arange(6, dtype="<f4").reshape(2, 3)
ACCESSOR = {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 2}
ONE_VIEW = {"bufferViews": [{"buffer": 0, "byteLength": 24}], "accessors": [ACCESSOR]}
BALL = trimesh.creation.icosphere(2)
JOINTS = np.arange(4 * len(BALL.vertices)).reshape(-1, 4) % 7


def made(document: dict[str, Any] | None = None, blob: bytes = b"") -> Glb:
    return Glb(NAME, {"asset": {"version": "2.0"}, **(document or {})}, blob)


def reread(glb: Glb) -> Glb:
    return Glb.parse(glb.to_bytes(), NAME)


@pytest.mark.parametrize("dtype", ["u1", "<i2", "<u4", "<f4"])
@pytest.mark.parametrize("components", [1, 2, 3, 4])
def test_arrays_come_back_as_they_were_stored(dtype: str, components: int) -> None:
    values = np.arange(5 * components).reshape(5, components).astype(dtype)
    glb = made()
    first, second = glb.add_array(values), glb.add_array(values[:1])
    glb = reread(glb)
    np.testing.assert_array_equal(glb.stored(first), values)
    np.testing.assert_array_equal(glb.stored(second), values[:1])
    assert glb.stored(first).dtype == dtype


def test_another_reader_understands_what_is_written() -> None:
    glb = made()
    glb.add_array(np.arange(6, dtype="<f4").reshape(2, 3), bounds=True)
    document = pygltflib.GLTF2.load_from_bytes(glb.to_bytes())
    assert document.accessors[0].max == [3, 4, 5]
    assert document.accessors[0].type == "VEC3"
    assert document.buffers[0].byteLength == 24


def test_what_is_not_understood_stays() -> None:
    document = {
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        "animations": [{"name": "walk", "channels": [], "samplers": []}],
        "extras": {"author": "Ännchen", "nothing": None, "empty": []},
        "somethingNew": {"a": [1, 2.5]},
    }
    assert reread(made(document)).document == {**made(document).document, "buffers": []}


def test_normalised_integers_are_read_as_fractions() -> None:
    glb = made()
    accessor = glb.add_array(np.array([[0, 128, 255]], "u1"))
    glb.document["accessors"][accessor]["normalized"] = True
    np.testing.assert_allclose(glb.array(accessor), [[0, 128 / 255, 1]])


def test_interleaved_and_sparse_values_are_read() -> None:
    table = np.zeros(3, [("position", "<f4", 3), ("other", "<f4", 2)])
    table["position"] = np.arange(9).reshape(3, 3)
    glb = made()
    view = glb.add_bytes(table.tobytes())
    glb.items("bufferViews")[view]["byteStride"] = table.itemsize
    entry = {"bufferView": view, "componentType": 5126, "type": "VEC3", "count": 3}
    sparse = {
        "count": 1,
        "indices": {"bufferView": glb.add_bytes(b"\1\0\0\0"), "componentType": 5121},
        "values": {"bufferView": glb.add_bytes(np.full(3, 7, "<f4").tobytes())},
    }
    glb.items("accessors").extend([entry, {**entry, "sparse": sparse}])
    glb = reread(glb)
    np.testing.assert_array_equal(glb.stored(0), table["position"])
    np.testing.assert_array_equal(glb.stored(1), [[0, 1, 2], [7, 7, 7], [6, 7, 8]])


@pytest.mark.parametrize(
    "change",
    [
        {"count": 1000},
        {"count": -1},
        {"count": 2**40},
        {"byteOffset": -8},
        {"bufferView": 9},
        {"bufferView": "0"},
        {"componentType": 1},
        {"type": "TENSOR"},
        {"count": None},
        {"count": "4"},
        {"count": True},
        {"count": 3.5},
        {"byteOffset": "0"},
        {"byteOffset": False},
        {"bufferView": False},
        {"sparse": {"count": -1}},
        {"sparse": 7},
    ],
)
def test_arrays_out_of_the_file_are_refused(change: dict[str, Any]) -> None:
    glb = made()
    accessor = glb.add_array(np.zeros((4, 3), "<f4"))
    glb.document["accessors"][accessor].update(change)
    with pytest.raises(FileFormatError, match=r"some\.glb: damaged"):
        reread(glb).stored(accessor)


@pytest.mark.parametrize(
    "change",
    [
        {"byteOffset": -4},
        {"byteOffset": "0"},
        {"byteLength": None},
        {"byteLength": 2**40},
        {"byteLength": True},
        {"byteStride": 1},
        {"byteStride": -12},
        {"byteStride": "12"},
        {"byteStride": 2**70},
        {"buffer": -1},
        {"buffer": "0"},
        {"buffer": 5},
    ],
)
def test_views_out_of_the_file_are_refused(change: dict[str, Any]) -> None:
    glb = made()
    accessor = glb.add_array(np.zeros((4, 3), "<f4"))
    glb.document["bufferViews"][0].update(change)
    with pytest.raises(FileFormatError, match=r"some\.glb: damaged"):
        reread(glb).stored(accessor)


def test_whole_numbers_with_a_point_are_whole_numbers() -> None:
    glb = made()
    accessor = glb.add_array(np.arange(6, dtype="<f4").reshape(2, 3))
    glb.document["accessors"][accessor] |= {"count": 2.0, "byteOffset": 0.0}
    glb.document["bufferViews"][0] |= {"byteOffset": 0.0, "byteLength": 24.0, "buffer": 0.0}
    np.testing.assert_array_equal(reread(glb).stored(accessor), [[0, 1, 2], [3, 4, 5]])


@pytest.mark.parametrize("kind", [5120, 5122, 5126])
def test_sparse_indices_that_may_be_negative_are_refused(kind: int) -> None:
    glb = made()
    sparse = {
        "count": 1,
        "indices": {"bufferView": glb.add_bytes(b"\xff" * 4), "componentType": kind},
        "values": {"bufferView": glb.add_bytes(np.ones(3, "<f4").tobytes())},
    }
    glb.items("accessors").append({**ACCESSOR, "sparse": sparse})
    glb.document["accessors"][0]["bufferView"] = glb.add_bytes(bytes(24))
    with pytest.raises(FileFormatError, match=r"some\.glb: damaged"):
        reread(glb).stored(0)


def test_zeros_without_bytes_are_not_made_without_end() -> None:
    glb = made({"accessors": [{"componentType": 5126, "type": "VEC3", "count": 2**40}]})
    with pytest.raises(FileFormatError, match="too many"):
        glb.stored(0)


@pytest.mark.parametrize(
    ("document", "line"),
    [
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, r"compressed \(EXT_meshopt"),
        ({"buffers": [{"uri": "other.bin", "byteLength": 4}]}, "outside the file"),
    ],
)
def test_what_cannot_be_read_is_said(document: dict[str, Any], line: str) -> None:
    with pytest.raises(FileFormatError, match=line):
        Glb.parse(packed(document), NAME)


def packed(document: dict[str, Any], blob: bytes = b"", *, fill: bytes = b" ") -> bytes:
    """A GLB file of which nothing is put right."""
    text = json.dumps({"asset": {"version": "2.0"}, **document}).encode()
    text += fill * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if blob:
        chunks += struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def as_uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


@pytest.mark.parametrize("more", [0, 1, 2, 3])
def test_zeros_behind_the_json_are_no_damage(more: int) -> None:
    document = {**ONE_VIEW, "buffers": [{"byteLength": 24}], "extras": "x" * more}
    glb = Glb.parse(packed(document, NUMBERS.tobytes(), fill=b"\0"), NAME)
    np.testing.assert_array_equal(glb.stored(0), NUMBERS)


@pytest.mark.parametrize("more", [b"\0", b"\0" * 9, b"\xff" * 64, struct.pack("<II", 9999, 7)])
def test_bytes_behind_the_end_that_the_file_names_are_ignored(more: bytes) -> None:
    document = {**ONE_VIEW, "buffers": [{"byteLength": 24}]}
    glb = Glb.parse(packed(document, NUMBERS.tobytes()) + more, NAME)
    np.testing.assert_array_equal(glb.stored(0), NUMBERS)


def test_a_length_that_the_file_never_wrote_is_no_damage() -> None:
    data = bytearray(packed({**ONE_VIEW, "buffers": [{"uri": as_uri(NUMBERS.tobytes())}]}))
    struct.pack_into("<I", data, 8, 0)
    np.testing.assert_array_equal(Glb.parse(bytes(data), NAME).stored(0), NUMBERS)


def test_buffers_that_are_text_join_the_binary_one() -> None:
    views = [
        {"buffer": 0, "byteLength": 24},
        {"buffer": 1, "byteOffset": 8, "byteLength": 24},
        {"buffer": 2, "byteLength": 24},
    ]
    unpadded = as_uri(bytes(8) + (2 * NUMBERS).tobytes()).rstrip("=")
    percent = "data:," + "".join(f"%{byte:02x}" for byte in (3 * NUMBERS).tobytes())
    document = {
        "buffers": [{"byteLength": 24, "name": "first"}, {"uri": unpadded}, {"uri": percent}],
        "bufferViews": views,
        "accessors": [{**ACCESSOR, "bufferView": view} for view in range(3)],
    }
    glb = Glb.parse(packed(document, NUMBERS.tobytes()), NAME)
    for each in (glb, reread(glb)):
        for factor in (1, 2, 3):
            np.testing.assert_array_equal(each.stored(factor - 1), factor * NUMBERS)
    written = pygltflib.GLTF2.load_from_bytes(glb.to_bytes())
    assert [buffer.uri for buffer in written.buffers] == [None]
    assert glb.document["buffers"][0]["name"] == "first"


@pytest.mark.parametrize(
    "document",
    [
        {"buffers": [{"uri": "data:;base64,@"}], **ONE_VIEW},
        {"buffers": [{"uri": 7}], **ONE_VIEW},
        {
            "buffers": [{}, {"uri": as_uri(b"1234")}],
            "bufferViews": [{"buffer": 1, "byteLength": 5}],
        },
        {"buffers": [{}], "bufferViews": [{"buffer": 3, "byteLength": 5}]},
        {"buffers": [{"uri": as_uri(b"1234")}], **ONE_VIEW},
    ],
    ids=range(5),
)
def test_buffers_that_do_not_hold_what_they_should_are_damage(document: dict[str, Any]) -> None:
    with pytest.raises(FileFormatError, match=r"some\.glb: damaged"):
        Glb.parse(packed(document), NAME).stored(0)


def test_plain_data_beside_what_meshopt_compressed_are_used() -> None:
    extension = {"EXT_meshopt_compression": {"buffer": 1, "byteOffset": 0, "count": 2}}
    document = {
        "buffers": [{"byteLength": 24}],
        "bufferViews": [{"buffer": 0, "byteLength": 24, "extensions": extension}],
        "accessors": [ACCESSOR],
        "extensionsUsed": ["EXT_meshopt_compression"],
    }
    glb = Glb.parse(packed(document, NUMBERS.tobytes()), NAME)
    np.testing.assert_array_equal(glb.stored(0), NUMBERS)
    assert b"meshopt" not in glb.to_bytes()


def test_a_few_values_beside_none_are_read() -> None:
    glb = made()
    glb.add_bytes(bytes(999))
    sparse = {
        "count": 2,
        "indices": {"bufferView": glb.add_bytes(b"\1\0\3\0"), "componentType": 5123},
        "values": {"bufferView": glb.add_bytes(NUMBERS.tobytes())},
    }
    accessor = {"componentType": 5126, "type": "VEC3", "count": 4, "sparse": sparse}
    glb.items("accessors").append(accessor)
    expected = np.zeros((4, 3))
    expected[[1, 3]] = NUMBERS
    np.testing.assert_array_equal(reread(glb).stored(0), expected)
    sparse["indices"]["bufferView"] = glb.add_bytes(b"\1\0\4\0")
    with pytest.raises(FileFormatError, match="damaged"):
        reread(glb).stored(0)


def test_files_that_are_cut_off_are_refused() -> None:
    glb = made()
    glb.add_array(np.zeros((100, 3), "<f4"))
    data = glb.to_bytes()
    for length in (0, 3, 12, 19, 30, len(data) - 4):
        with pytest.raises(FileFormatError):
            Glb.parse(data[:length], NAME).stored(0)


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 10**6), st.integers(0, 255))
def test_a_changed_byte_makes_no_other_error(at: int, value: int) -> None:
    glb = made()
    glb.add_array(np.arange(12, dtype="<f4").reshape(4, 3), bounds=True)
    data = bytearray(glb.to_bytes())
    data[at % len(data)] = value
    with suppress(VncaError):
        Glb.parse(bytes(data), NAME).array(0)


def compressed(path: Path, **change: Any) -> Path:
    """A ball with UVs and joints, everything compressed."""
    points, uv = BALL.vertices.astype(np.float32), np.abs(BALL.vertices[:, :2])
    data = DracoPy.encode(
        points, BALL.faces.astype(np.uint32), quantization_bits=14, preserve_order=True,
        tex_coord=uv, generic_attributes={5: JOINTS.astype(np.uint8)},
    )  # fmt: skip
    numbers = {
        each["attribute_type"]: each["unique_id"] for each in DracoPy.decode(data).attributes
    }
    glb = Glb(path, {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}]})
    count = len(points)
    glb.document["accessors"] = [
        {"componentType": 5126, "type": "VEC3", "count": count, "min": [-1] * 3, "max": [1] * 3},
        {"componentType": 5126, "type": "VEC2", "count": count},
        {"componentType": 5123, "type": "VEC4", "count": count, "name": "joints"},
        {"componentType": 5125, "type": "SCALAR", "count": BALL.faces.size},
    ]
    extension = {
        "bufferView": glb.add_bytes(data),
        "attributes": {"POSITION": numbers[0], "TEXCOORD_0": numbers[3], "JOINTS_0": 5},
        **change,
    }
    attributes = {"POSITION": 0, "TEXCOORD_0": 1, "JOINTS_0": 2}
    primitive = {"attributes": attributes, "indices": 3, "extensions": {EXTENSION: extension}}
    glb.document["meshes"] = [{"primitives": [primitive]}]
    glb.document["nodes"] = [{"mesh": 0}]
    for listed in ("extensionsUsed", "extensionsRequired"):
        glb.document[listed] = [EXTENSION, "KHR_materials_unlit"]
    glb.write(path)
    return path


def test_a_compressed_mesh_is_read_and_written_plain(tmp_path: Path) -> None:
    mesh = read_mesh(compressed(tmp_path / "a.glb"))
    (surface,) = mesh.surfaces
    np.testing.assert_allclose(
        surface.points, BALL.vertices @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-3
    )
    np.testing.assert_array_equal(surface.faces, BALL.faces)
    np.testing.assert_allclose(surface.uv, np.abs(BALL.vertices[:, :2]), atol=1e-3)
    mesh.glb.write(tmp_path / "plain.glb")
    (shape,) = trimesh.load_scene(tmp_path / "plain.glb").geometry.values()
    assert shape.area == pytest.approx(BALL.area, rel=1e-3)
    (primitive,) = mesh.glb.document["meshes"][0]["primitives"]
    np.testing.assert_array_equal(mesh.glb.stored(primitive["attributes"]["JOINTS_0"]), JOINTS)
    assert mesh.glb.stored(primitive["attributes"]["JOINTS_0"]).dtype == "<u2"
    assert "extensions" not in primitive
    assert mesh.glb.document["extensionsRequired"] == ["KHR_materials_unlit"]


def test_plain_vertices_beside_the_compressed_ones_are_kept_alone(tmp_path: Path) -> None:
    glb = Glb.read(compressed(tmp_path / "a.glb"))
    plain = (2 * BALL.vertices, BALL.vertices[:, :2], JOINTS, BALL.faces)
    for entry, values, kind in zip(
        glb.document["accessors"], plain, ("<f4", "<f4", "<u2", "<u4"), strict=True
    ):
        entry["bufferView"] = glb.add_bytes(np.asarray(values).astype(kind).tobytes())
    glb.document["extensionsRequired"] = []
    glb.write(tmp_path / "both.glb")
    mesh = read_mesh(tmp_path / "both.glb")
    assert mesh.bounds[1].max() == pytest.approx(2)
    assert "extensions" not in mesh.surfaces[0].primitive
    assert EXTENSION not in mesh.glb.document["extensionsUsed"]


@pytest.mark.parametrize(
    "change",
    [
        {"bufferView": 9},
        {"attributes": {"POSITION": 77}},
        {"attributes": {"NORMAL": 0}},
        {"attributes": None},
    ],
)
def test_damage_is_one_line(tmp_path: Path, change: dict[str, Any]) -> None:
    with pytest.raises(FileFormatError, match=r"a\.glb: damaged"):
        read_mesh(compressed(tmp_path / "a.glb", **change))


def test_bytes_that_are_not_compressed_are_one_line(tmp_path: Path) -> None:
    glb = Glb.read(compressed(tmp_path / "a.glb"))
    (primitive,) = glb.document["meshes"][0]["primitives"]
    primitive["extensions"][EXTENSION]["bufferView"] = glb.add_bytes(b"no mesh at all")
    glb.write(tmp_path / "b.glb")
    with pytest.raises(FileFormatError, match=r"b\.glb: damaged"):
        read_mesh(tmp_path / "b.glb")


def test_another_number_of_vertices_than_told_is_refused(tmp_path: Path) -> None:
    glb = Glb.read(compressed(tmp_path / "a.glb"))
    glb.document["accessors"][2]["count"] = 3
    glb.write(tmp_path / "b.glb")
    with pytest.raises(FileFormatError, match="another number of vertices"):
        read_mesh(tmp_path / "b.glb")


def test_without_the_decoder_the_line_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(BackendUnavailableError, match=r"a\.glb.*DracoPy.*vnca\[texture\]"):
        read_mesh(compressed(tmp_path / "a.glb"))
