import sys
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pytest
import trimesh

from vnca.errors import BackendUnavailableError, FileFormatError
from vnca.io.draco import EXTENSION
from vnca.io.glb import Glb
from vnca.io.mesh import read_mesh

BALL = trimesh.creation.icosphere(2)
JOINTS = np.arange(4 * len(BALL.vertices)).reshape(-1, 4) % 7


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
