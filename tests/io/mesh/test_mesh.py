import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from vnca.core.errors import FileFormatError, GridError, OptionError, VncaError
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.mesh.glb import Glb
from vnca.io.mesh.texture import base_colours

DATA = Path(__file__).parents[2] / "data"
BOX = trimesh.creation.box((1, 2, 3))


def saved(path: Path, mesh: trimesh.Trimesh | trimesh.Scene = BOX) -> Path:
    mesh.export(path)
    return path


def area(mesh: Mesh) -> float:
    total = 0.0
    for surface in mesh.surfaces:
        a, b, c = surface.points[surface.faces].transpose(1, 0, 2)
        total += np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return total


def extents(mesh: Mesh) -> list[float]:
    low, high = mesh.bounds
    return (high - low).tolist()


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply", "stl"])
def test_every_format_gives_the_same_surface(tmp_path: Path, suffix: str) -> None:
    mesh = read_mesh(saved(tmp_path / f"box.{suffix}"), "y")
    assert area(mesh) == pytest.approx(2 * (1 * 2 + 2 * 3 + 1 * 3))
    assert mesh.face_count == 12
    # Up is z here, and was y in the file.
    assert extents(mesh) == pytest.approx([1, 3, 2])


@pytest.mark.parametrize(("suffix", "stands"), [("obj", 2), ("ply", 3), ("stl", 3), ("glb", 2)])
def test_the_up_axis_is_that_of_the_format_unless_given(
    tmp_path: Path, suffix: str, stands: float
) -> None:
    path = saved(tmp_path / f"box.{suffix}")
    assert extents(read_mesh(path))[2] == pytest.approx(stands)
    if suffix != "glb":
        assert extents(read_mesh(path, "z"))[2] == pytest.approx(3)


def test_a_glb_file_that_is_said_to_lie_on_its_side_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="always y"):
        read_mesh(saved(tmp_path / "box.glb"), "z")


def test_objects_are_placed_as_their_scene_places_them(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    half = trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0))
    moved = trimesh.transformations.translation_matrix((10, 0, 0)) @ half
    scene.add_geometry(BOX, node_name="a", geom_name="box")
    scene.add_geometry(trimesh.creation.icosphere(1), node_name="b", transform=moved)
    mesh = read_mesh(saved(tmp_path / "two.glb", scene))
    assert len(mesh.surfaces) == 2
    assert mesh.bounds[1][0] == pytest.approx(11)
    assert mesh.face_count == 12 + 80


def test_scaled_rotated_and_nested_nodes_are_followed(tmp_path: Path) -> None:
    glb = Glb.read(saved(tmp_path / "box.glb"))
    quarter = [0.0, 0.0, 0.5**0.5, 0.5**0.5]  # about z: x becomes y
    glb.document["nodes"] = [
        {"children": [1], "translation": [0, 0, 5]},
        {"mesh": 0, "rotation": quarter, "scale": [10, 1, 1]},
    ]
    glb.document["scenes"] = [{"nodes": [0]}]
    glb.write(tmp_path / "nested.glb")
    mesh = read_mesh(tmp_path / "nested.glb")
    # In the file: (2, 10, 3) around (0, 0, 5); y of the file is up.
    assert extents(mesh) == pytest.approx([2, 3, 10])
    assert mesh.bounds[0][1] == pytest.approx(-6.5)


def test_strips_and_fans_are_triangles(tmp_path: Path) -> None:
    glb = Glb(tmp_path, {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1]}]})
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    around = square[[0, 1, 3, 2]]
    for mode, points in ((5, square), (6, around)):
        primitive = {"attributes": {"POSITION": glb.add_array(points)}, "mode": mode}
        glb.items("meshes").append({"primitives": [primitive]})
        glb.items("nodes").append({"mesh": len(glb.items("meshes")) - 1})
    glb.write(tmp_path / "modes.glb")
    mesh = read_mesh(tmp_path / "modes.glb")
    assert [len(surface.faces) for surface in mesh.surfaces] == [2, 2]
    assert area(mesh) == pytest.approx(2)
    for surface in mesh.surfaces:
        a, b, c = surface.points[surface.faces].transpose(1, 0, 2)
        assert (np.cross(b - a, c - a)[:, 1] < 0).all()  # all face the same way


def test_a_node_that_is_its_own_child_does_not_hang(tmp_path: Path) -> None:
    glb = Glb.read(saved(tmp_path / "box.glb"))
    glb.document["nodes"] = [{"mesh": 0, "children": [0]}]
    glb.document["scenes"] = [{"nodes": [0]}]
    glb.write(tmp_path / "loop.glb")
    assert len(read_mesh(tmp_path / "loop.glb").surfaces) == 1


def test_meshes_that_are_open_or_inside_out_are_read(tmp_path: Path) -> None:
    broken = BOX.copy()
    broken.update_faces(np.arange(12) > 3)
    broken.invert()
    assert read_mesh(saved(tmp_path / "open.obj", broken)).face_count == 8


def obj(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (TRIANGLE, "no triangles"),
        (TRIANGLE.replace("1 0 0", "nan 0 0") + "f 1 2 3\n", "not finite"),
        (TRIANGLE.replace("1 0 0", "1e60 0 0") + "f 1 2 3\n", "not finite"),
        ("v 1 1 1\n" * 3 + "f 1 2 3\n", "one point"),
        (TRIANGLE + "f 1 2 9\n", "damaged"),
        ("not a mesh at all\n", "no triangles|damaged"),
        ("v a b c\nf 1 2 3\n", "no triangles|damaged"),
    ],
)
def test_meshes_that_cannot_be_textured_are_refused(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(VncaError, match=line) as refused:
        read_mesh(obj(tmp_path / "bad.obj", text))
    assert "bad.obj" in str(refused.value)


@pytest.mark.parametrize("suffix", ["glb", "ply", "stl"])
@pytest.mark.parametrize("content", [b"", b"ply\nformat", b"\0" * 100, b"solid"])
def test_files_that_are_no_meshes_are_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"bad.{suffix}"
    path.write_bytes(content)
    with pytest.raises((FileFormatError, GridError), match="bad"):
        read_mesh(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mesh.fbx"
    path.write_bytes(b"x")
    with pytest.raises(FileFormatError, match="expected a mesh"):
        read_mesh(path)


def test_a_damaged_document_is_told_of(tmp_path: Path) -> None:
    for broken in (
        {"nodes": [{"mesh": 7}]},
        {"meshes": [{"primitives": [{"attributes": {"POSITION": 99}}]}]},
        {"meshes": [{}]},
        {"nodes": ["what"]},
        {"nodes": [{"mesh": 0, "matrix": [1, 2]}]},
        {"scenes": [{"nodes": [5]}]},
    ):
        glb = Glb.read(saved(tmp_path / "box.glb"))
        glb.document.update(broken)
        glb.write(tmp_path / "broken.glb")
        with pytest.raises(FileFormatError, match="damaged"):
            read_mesh(tmp_path / "broken.glb")


@pytest.mark.parametrize(
    "document",
    [
        {"buffers": 3},
        {"buffers": [7]},
        {"extensionsRequired": 1},
        {"meshes": [], "nodes": [[1]], "scenes": [{"nodes": [0]}]},
        {"nodes": {"mesh": 0}},
        {"nodes": "mesh"},
        {"images": [None]},
        {
            "accessors": [{"componentType": 5126, "type": "VEC3", "count": "1"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "nodes": [{"mesh": 0}],
        },
    ],
    ids=range(8),
)
def test_json_of_another_kind_than_expected_is_one_clear_line(
    tmp_path: Path, document: dict[str, Any]
) -> None:
    text = json.dumps(document).encode()
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    path = tmp_path / "a.glb"
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk)
    with pytest.raises(FileFormatError, match=r"a\.glb: damaged"):
        read_mesh(path)


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_of_the_json_that_are_not_finite_are_one_clear_line(
    tmp_path: Path, value: str
) -> None:
    text = f'{{"extras": [1.5, {value}]}}'.encode()
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    path = tmp_path / "a.glb"
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk)
    with pytest.raises(FileFormatError, match=rf"a\.glb: .* not finite \({value}\)"):
        read_mesh(path)


@pytest.mark.parametrize(
    ("name", "count"), [("rotation", 4), ("scale", 3), ("translation", 3), ("matrix", 16)]
)
@pytest.mark.parametrize(
    "value",
    # Numpy takes most of these: a text times a number is many texts.
    [
        lambda n: "1" * n,
        lambda n: ["x"] * n,
        lambda n: ["1"] * n,
        lambda n: [True] * n,
        lambda _: 1,
        lambda _: [1],
        lambda n: [1] * (n + 1),
        lambda n: [[1] * n],
        lambda n: dict.fromkeys("abcdefghijklmnop"[:n], 1),
        lambda _: None,
        lambda n: [10**400] * n,
    ],
    ids=range(11),
)
def test_the_place_of_a_node_is_so_many_numbers_or_damage(
    tmp_path: Path, name: str, count: int, value: Callable[[int], Any]
) -> None:
    glb = Glb.read(saved(tmp_path / "a.glb"))
    glb.document["nodes"] = [{"mesh": 0, name: value(count)}]
    glb.document["scenes"] = [{"nodes": [0]}]
    glb.write(tmp_path / "b.glb")
    with pytest.raises(FileFormatError, match=r"b\.glb: damaged"):
        read_mesh(tmp_path / "b.glb")


def test_texts_in_a_large_turn_are_not_repeated(tmp_path: Path) -> None:
    glb = Glb.read(saved(tmp_path / "a.glb"))
    glb.document["nodes"] = [{"mesh": 0, "rotation": [2**40, 2**40, 2**40, 1], "scale": ["x"] * 3}]
    glb.document["scenes"] = [{"nodes": [0]}]
    glb.write(tmp_path / "b.glb")
    with pytest.raises(FileFormatError, match="`scale` should be 3 finite numbers"):
        read_mesh(tmp_path / "b.glb")


@pytest.mark.parametrize(
    "change",
    [
        {"nodes": [{"mesh": True}]},
        {"nodes": [{"mesh": 0.5}]},
        {"nodes": [{"mesh": "0"}]},
        {"nodes": [{"mesh": -1}]},
        {"nodes": [{"mesh": [0]}]},
        {"nodes": [{"mesh": 0, "children": [-1]}]},
        {"nodes": [{"mesh": 0, "children": [False]}]},
        {"nodes": [{"mesh": 0, "children": "0"}]},
        {"nodes": [{"mesh": 0, "children": 1}]},
        {"scenes": [{"nodes": [False]}]},
        {"scenes": [{"nodes": ["0"]}]},
        {"scenes": [{"nodes": 0}]},
        {"meshes": [{"primitives": 1}]},
        {"meshes": [{"primitives": ["x"]}]},
        {"meshes": [{"primitives": [{"attributes": "POSITION"}]}]},
        {"meshes": [{"primitives": [{"attributes": {"POSITION": False}}]}]},
    ],
    ids=str,
)
def test_numbers_of_entries_that_are_none_are_damage(
    tmp_path: Path, change: dict[str, Any]
) -> None:
    glb = Glb.read(saved(tmp_path / "a.glb"))
    glb.document |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], **change}
    glb.write(tmp_path / "b.glb")
    with pytest.raises(FileFormatError, match=r"b\.glb: damaged"):
        read_mesh(tmp_path / "b.glb")


@pytest.mark.parametrize(
    "values",
    [np.arange(3, dtype="<f4"), np.arange(3, dtype="i1"), np.arange(6, dtype="u1").reshape(3, 2)],
)
def test_indices_that_are_no_counting_numbers_are_damage(
    tmp_path: Path, values: np.ndarray
) -> None:
    glb = Glb.read(saved(tmp_path / "a.glb"))
    (mesh,) = glb.items("meshes")
    mesh["primitives"][0]["indices"] = glb.add_array(values.reshape(3, -1))
    glb.write(tmp_path / "b.glb")
    with pytest.raises(FileFormatError, match=r"b\.glb: damaged"):
        read_mesh(tmp_path / "b.glb")


def test_parts_that_share_vertices_cannot_multiply_them_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    glb = Glb.read(saved(tmp_path / "a.glb"))
    (mesh,) = glb.items("meshes")
    mesh["primitives"] *= 10
    glb.write(tmp_path / "b.glb")
    assert len(read_mesh(tmp_path / "b.glb").surfaces) == 10
    monkeypatch.setattr("vnca.io.mesh.MOST_VERTICES", 5 * len(BOX.vertices))
    with pytest.raises(FileFormatError, match="more than 40 vertices together"):
        read_mesh(tmp_path / "b.glb")


def test_an_obj_file_cannot_bring_pictures_from_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "secret.png")
    (tmp_path / "inside" / "a.mtl").write_text(f"newmtl m\nmap_Kd {tmp_path}/secret.png\n")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd secret.png\n")
    for library in ("a.mtl", "../a.mtl"):
        path = obj(
            tmp_path / "inside" / "a.obj",
            f"mtllib {library}\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n",
        )
        assert all(colour.picture.shape == (1, 1, 3) for colour in base_colours(read_mesh(path)))


@pytest.mark.parametrize(
    ("name", "expected"), [("nulpad.glb", 12.6965), ("datauri.glb", 12.6965), ("ngon.obj", 2.5)]
)
def test_files_of_the_field_have_the_area_they_should(name: str, expected: float) -> None:
    assert area(read_mesh(DATA / name)) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("kind", ["i1", "u1", "<i2", "<u2"])
@pytest.mark.parametrize("normalized", [True, False])
def test_quantised_positions_are_put_where_their_node_says(
    tmp_path: Path, kind: str, normalized: bool
) -> None:
    """KHR_mesh_quantization, as gltfpack writes it; trimesh scales nothing, so numpy judges."""
    glb = Glb(tmp_path, {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}]})
    most = np.iinfo(kind).max
    corners = np.array([[0, 0, 0], [most, 0, 0], [0, most, 0], [0, 0, most]], kind)
    accessor = glb.add_array(corners, bounds=True)
    scale = 2 if normalized else 2 / most
    if normalized:
        glb.item("accessors", accessor)["normalized"] = True
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], "u1")
    primitive = {
        "attributes": {"POSITION": accessor},
        "indices": glb.add_array(faces.reshape(-1, 1)),
    }
    glb.document["meshes"] = [{"primitives": [primitive]}]
    glb.document["nodes"] = [{"mesh": 0, "scale": [scale] * 3, "translation": [1, 1, 1]}]
    for listed in ("extensionsUsed", "extensionsRequired"):
        glb.document[listed] = ["KHR_mesh_quantization"]
    glb.write(tmp_path / "q.glb")
    mesh = read_mesh(tmp_path / "q.glb")
    assert extents(mesh) == pytest.approx([2, 2, 2])
    assert mesh.bounds[0].tolist() == pytest.approx([1, -3, 1])
    assert area(mesh) == pytest.approx(3 * 2 + np.sqrt(3) / 4 * 8)
