"""OBJ and PLY files of every kind that programs write, against what they mean."""

import struct
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from vnca.core.errors import VncaError
from vnca.io.mesh import read_mesh
from vnca.io.mesh.obj_ply import PlyMesh, parse_ply, plain_obj
from vnca.io.mesh.texture import base_colours

SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
POINTS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0), (0, 0, 1)]
NOTCHED = (0, 1, 2, 3, 4)
ORDERS = ("ascii", "binary_little_endian", "binary_big_endian")


def faces(text: bytes) -> list[bytes]:
    return [line for line in plain_obj(text).split(b"\n") if line.startswith(b"f ")]


def areas(tmp_path: Path, text: bytes) -> list[float]:
    (tmp_path / "a.obj").write_bytes(text)
    found = []
    for surface in read_mesh(tmp_path / "a.obj").surfaces:
        a, b, c = surface.points[surface.faces].transpose(1, 0, 2)
        found.append(float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2))
    return found


def test_a_file_of_triangles_stays_as_it_is() -> None:
    text = b"mtllib a b.mtl\no x\n" + SQUARE + b"usemtl \xe9\nf 1 2 3\nf 1/1 3/2 4/3 # 5 6\n"
    assert plain_obj(text) == text


def test_a_concave_polygon_of_the_field_has_its_own_area(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "data/ngon.obj").read_bytes()
    assert areas(tmp_path, text) == pytest.approx([2.5])


def test_corners_keep_their_uvs_and_normals() -> None:
    text = SQUARE + b"vt 0 0\n" * 4 + b"vn 0 0 1\n" + b"f 1/4/1 2/3/1 3/2/1 4/1/1\n"
    assert faces(text) == [b"f 1/4/1 2/3/1 3/2/1", b"f 1/4/1 3/2/1 4/1/1"]


def test_relative_numbers_count_from_the_line_of_the_face(tmp_path: Path) -> None:
    moved = SQUARE.replace(b"1", b"3")
    text = SQUARE + b"f -4 -3 -2\n" + moved + b"f -4 -3 -2 -1\nf 1 -5 -6\n"
    assert faces(text) == [b"f 1 2 3", b"f 5 6 7", b"f 5 7 8", b"f 1 4 3"]
    assert sum(areas(tmp_path, text)) == pytest.approx(0.5 + 9 + 0.5)


def test_relative_numbers_count_uvs_and_normals_apart() -> None:
    text = b"vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n" + SQUARE + b"f -4/-3/-1 -3/-2/-1 -2/-1/-1\n"
    assert faces(text) == [b"f 1/1/1 2/2/1 3/3/1"]
    assert faces(SQUARE + b"vn 0 0 1\nf -4//-1 -3//-1 -2//-1\n") == [b"f 1//1 2//1 3//1"]


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: text.replace(b"\n", b"\r"),
        lambda text: text.replace(b" 3 4", b" \\\n3 4"),
        lambda text: text.replace(b"v ", b"  v\t").replace(b"f ", b"\tf  "),
        lambda text: text.replace(b"4\n", b"4 # the last\n"),
        lambda text: text.rstrip(b"\n"),
        lambda text: text.replace(b"f ", b"usemtl m\ns 1\nf "),
    ],
    ids=["crlf", "cr", "continued", "indented", "comment", "no newline", "material"],
)
def test_however_it_is_written_it_is_the_same_square(tmp_path: Path, change) -> None:
    assert areas(tmp_path, change(SQUARE + b"f 1 2 3 4\n")) == pytest.approx([1])


def test_materials_keep_their_polygons(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n")
    text = b"mtllib m.mtl\n" + SQUARE + b"usemtl a\nf 1 2 3 4\nusemtl b\nf 1 2 3\n"
    assert sorted(areas(tmp_path, text)) == pytest.approx([0.5, 1])


@pytest.mark.parametrize("line", [b"f 1 2 3 9", b"f 1 2 3 x", b"f -9 1 2", b"f 0 1 2 3"])
def test_faces_that_cannot_be_are_refused(line: bytes) -> None:
    with pytest.raises(ValueError, match=r"not there|invalid"):
        plain_obj(SQUARE + line + b"\n")


def ply(
    faces: list[tuple[int, ...]],
    order: str = "binary_little_endian",
    *,
    uv: Any = None,
    name: str = "vertex_indices",
) -> bytes:
    """The file; vertices have a colour, faces a flag before and behind their vertices."""
    header = f"ply\nformat {order} 1.0\ncomment made by a test\nelement vertex {len(POINTS)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += "".join(f"property uchar {colour}\n" for colour in ("red", "green", "blue"))
    header += f"element face {len(faces)}\nproperty uchar flag\nproperty list uchar int {name}\n"
    header += "" if uv is None else "property list uchar float texcoord\n"
    header += "property short last\nend_header\n"
    rows: list[list[tuple[str, Any]]] = [
        [(c, v) for c, v in zip("fffBBB", (*point, 10, 20, 30), strict=True)] for point in POINTS
    ]
    for number, face in enumerate(faces):
        row = [("B", 7), ("B", len(face)), *(("i", corner) for corner in face)]
        if uv is not None:
            values = np.ravel(uv[number])
            row += [("B", len(values)), *(("f", value) for value in values)]
        rows.append([*row, ("h", -1)])
    if order == "ascii":
        body = "\n".join(" ".join(str(value) for _, value in row) for row in rows).encode()
    else:
        sign = "<" if "little" in order else ">"
        body = b"".join(struct.pack(sign + code, value) for row in rows for code, value in row)
    return header.encode() + body


def area(mesh: PlyMesh) -> float:
    a, b, c = mesh.points[mesh.faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(
    ("faces", "expected"),
    [
        ([(0, 1, 2)], 2),
        ([NOTCHED], 2.5),
        ([(0, 1, 2, 4), (4, 2, 1, 0)], 8),
        ([(0, 1, 5), NOTCHED], 3.5),
        ([(0, 1, 5), (0, 1, 2, 3), (1, 2, 4, 0), (0, 1)], 1 + 1.5 + 4),
    ],
)
def test_polygons_of_any_kind_and_order_of_bytes_are_read(
    order: str, faces: list[tuple[int, ...]], expected: float
) -> None:
    mesh = parse_ply(ply(faces, order))
    assert area(mesh) == pytest.approx(expected)
    assert mesh.colours is not None
    assert mesh.colours.tolist() == [[10, 20, 30]] * len(POINTS)
    assert mesh.normals is None


@pytest.mark.parametrize("order", ORDERS)
def test_uvs_of_corners_split_vertices_only_where_they_differ(order: str) -> None:
    uv = [[(p[0] / 2, p[1] / 2) for p in (POINTS[i] for i in NOTCHED)], [(0, 0), (1, 0), (9, 9)]]
    mesh = parse_ply(ply([NOTCHED, (0, 1, 5)], order, uv=uv))
    assert len(mesh.points) == 6
    assert mesh.uv is not None
    assert mesh.uv[np.argmax(mesh.points[:, 2])].tolist() == [9, 9]
    flat = mesh.points[:, 2] == 0
    np.testing.assert_allclose(2 * mesh.uv[flat], mesh.points[flat, :2])
    uv[1][0] = (0.5, 0.5)
    assert len(parse_ply(ply([NOTCHED, (0, 1, 5)], order, uv=uv)).points) == 7


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_it_reads_what_trimesh_writes(encoding: str) -> None:
    ball = trimesh.creation.icosphere(2)
    data = trimesh.exchange.ply.export_ply(ball, encoding=encoding, vertex_normal=True)
    mesh = parse_ply(data)
    np.testing.assert_allclose(mesh.points, ball.vertices, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, ball.faces)
    np.testing.assert_allclose(mesh.normals, ball.vertex_normals, atol=1e-6)


@pytest.mark.parametrize("names", [("u", "v"), ("s", "t"), ("texture_u", "texture_v")])
def test_uvs_of_vertices_are_known_by_several_names(names: tuple[str, str]) -> None:
    text = ply([NOTCHED], "ascii").replace(b"uchar red", f"float {names[0]}".encode())
    mesh = parse_ply(text.replace(b"uchar blue", f"float {names[1]}".encode()))
    assert mesh.uv is not None
    assert mesh.uv.tolist() == [[10, 30]] * 6
    assert mesh.colours is None


def test_a_named_picture_beside_the_file_comes_along(tmp_path: Path) -> None:
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "a b.png")
    uv = [[(0, 0)] * 5]
    data = ply([NOTCHED], uv=uv).replace(b"comment made by a test", b"comment TextureFile a b.png")
    (tmp_path / "a.ply").write_bytes(data)
    (colour,) = base_colours(read_mesh(tmp_path / "a.ply"))
    assert colour.picture.shape == (4, 4, 3)
    (tmp_path / "a b.png").write_bytes(b"no picture")
    assert base_colours(read_mesh(tmp_path / "a.ply"))[0].picture.shape == (1, 1, 3)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-40],
        lambda data: data.replace(b"1.0", b"2.0"),
        lambda data: data.replace(b"property float x", b"property quad x"),
        lambda data: data.replace(b"list uchar int", b"list uchar"),
        lambda data: data.replace(b"element face 2", b"element face -2\nwhat 3"),
        lambda data: data.replace(b"end_header", b"end"),
        lambda data: data.replace(b"property float x\n", b""),
        lambda data: data.replace(b"element face 2", b"element face 999999999"),
        lambda data: data.replace(b"element vertex 6", b"element vertex 4"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, change) -> None:
    for order in ORDERS:
        data = change(ply([NOTCHED, (0, 1, 5)], order))
        (tmp_path / "a.ply").write_bytes(data)
        with pytest.raises(VncaError, match=r"a\.ply"):
            read_mesh(tmp_path / "a.ply")


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 10**6), st.integers(0, 255), st.sampled_from(ORDERS))
def test_a_changed_byte_makes_no_other_error(at: int, value: int, order: str) -> None:
    data = bytearray(ply([NOTCHED, (0, 1, 5)], order))
    data[at % len(data)] = value
    known = (ValueError, KeyError, IndexError, UnicodeDecodeError, OverflowError, TypeError)
    with suppress(*known), np.errstate(all="ignore"):
        parse_ply(bytes(data))


def test_another_reader_agrees_about_triangles() -> None:
    data = ply([(0, 1, 5), (1, 2, 5)])
    theirs = trimesh.load_mesh(BytesIO(data), "ply", process=False)
    np.testing.assert_array_equal(parse_ply(data).faces, theirs.faces)
