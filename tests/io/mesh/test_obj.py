from pathlib import Path

import numpy as np
import pytest

from vnca.io.mesh.mesh import read_mesh
from vnca.io.mesh.obj import plain_obj

SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


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
