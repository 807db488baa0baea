import base64
import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image

from vnca.core.colour import srgb_to_linear
from vnca.core.errors import FileFormatError
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.mesh.glb import Glb
from vnca.io.mesh.texture import Unwrapping, base_colours, put_on, write_coloured


def png(colour: tuple[int, int, int] = (200, 100, 50)) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (4, 4), colour).save(stream, "PNG")
    return stream.getvalue()


def split(mesh: Mesh) -> list[Unwrapping]:
    """UVs for which every corner of every face is a vertex of its own."""
    made = []
    for surface in mesh.surfaces:
        faces = np.arange(surface.faces.size).reshape(-1, 3)
        uv = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(faces), 1))
        made.append(Unwrapping(faces, uv, surface.faces.ravel()))
    return made


def textured(tmp_path: Path, mesh: Mesh, unwrappings: list[Unwrapping] | None = None) -> Path:
    put_on(mesh, unwrappings or split(mesh), png())
    path = tmp_path / "textured.glb"
    mesh.glb.write(path)
    return path


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    path = tmp_path / "plain.glb"
    trimesh.creation.box((1, 2, 3)).export(path)
    return path


def test_trimesh_and_pygltflib_find_the_texture(plain: Path, tmp_path: Path) -> None:
    path = textured(tmp_path, read_mesh(plain))
    (mesh,) = trimesh.load_scene(path).geometry.values()
    assert mesh.area == pytest.approx(22)
    assert mesh.visual.uv.shape == (36, 2)
    assert mesh.visual.material.baseColorTexture.getpixel((1, 1)) == (200, 100, 50)
    document = pygltflib.GLTF2.load(str(path))
    shading = document.materials[-1].pbrMetallicRoughness
    assert shading is not None
    assert (shading.metallicFactor, shading.roughnessFactor) == (0.0, 0.8)
    assert document.materials[-1].doubleSided
    assert document.images[0].mimeType == "image/png"


def test_it_reads_its_own_base_colours(plain: Path, tmp_path: Path) -> None:
    mesh = read_mesh(textured(tmp_path, read_mesh(plain)))
    (colour,) = base_colours(mesh)
    expected = srgb_to_linear(np.array([200, 100, 50]) / 255)
    np.testing.assert_allclose(colour.picture, np.broadcast_to(expected, (4, 4, 3)), atol=1e-6)
    assert colour.uv.shape == (36, 2)


def test_nothing_of_the_original_is_lost(tmp_path: Path) -> None:
    corners = 3
    glb = Glb(tmp_path, {"asset": {"version": "2.0"}})
    random = np.random.default_rng(0)
    values = {
        "POSITION": np.eye(3, dtype="<f4"),
        "NORMAL": np.ones((corners, 3), "<f4"),
        "TEXCOORD_0": random.random((corners, 2)).astype("<f4"),
        "COLOR_0": random.integers(0, 255, (corners, 3)).astype("u1"),
        "JOINTS_0": np.zeros((corners, 4), "u1"),
        "WEIGHTS_0": np.ones((corners, 4), "<f4"),
        "_TEMPERATURE": random.random((corners, 1)).astype("<f4"),
    }
    attributes = {name: glb.add_array(array) for name, array in values.items()}
    glb.document["accessors"][attributes["COLOR_0"]]["normalized"] = True
    target = {"POSITION": glb.add_array(random.random((corners, 3)).astype("<f4"))}
    primitive = {"attributes": attributes, "targets": [target], "material": 0}
    glb.document |= {
        "meshes": [{"name": "face", "primitives": [primitive], "weights": [0.5]}],
        "nodes": [{"mesh": 0, "skin": 0, "translation": [9, 9, 9], "extras": {"id": 7}}, {}],
        "skins": [{"joints": [1]}],
        "scenes": [{"nodes": [0, 1]}],
        "cameras": [{"type": "orthographic"}],
        "animations": [{"name": "nod", "channels": [], "samplers": []}],
        "materials": [
            {
                "name": "skin",
                "alphaMode": "BLEND",
                "emissiveFactor": [0, 0, 1],
                "normalTexture": {"index": 0},
                "pbrMetallicRoughness": {
                    "baseColorFactor": [1, 0, 0, 0.5],
                    "baseColorTexture": {"index": 0},
                    "metallicFactor": 0.3,
                },
                "extensions": {"KHR_materials_pbrSpecularGlossiness": {}, "KHR_other": {}},
            }
        ],
        "textures": [{"source": 0}],
        "images": [{"name": "old", "mimeType": "image/png", "bufferView": glb.add_bytes(png())}],
    }
    glb.write(tmp_path / "all.glb")
    before = Glb.read(tmp_path / "all.glb")
    mesh = read_mesh(tmp_path / "all.glb")
    assert mesh.bounds[1].max() == 1  # the bones place it, not its node
    (whole,) = mesh.surfaces
    source = np.array([2, 0, 1, 2])
    unwrapping = Unwrapping(np.array([[1, 2, 3]]), random.random((4, 2)), source)
    after = Glb.read(textured(tmp_path, mesh, [unwrapping]))

    for kind in ("nodes", "skins", "scenes", "cameras", "animations"):
        assert after.document[kind] == before.document[kind]
    for kind in ("materials", "textures", "images"):
        assert after.document[kind][:1] == before.document[kind]
        assert len(after.document[kind]) == 2
    primitive = after.document["meshes"][0]["primitives"][0]
    names = {"COLOR_0": "_COLOR_0"}  # else it would tint the texture
    for name, array in values.items():
        found = after.stored(primitive["attributes"][names.get(name, name)])
        np.testing.assert_array_equal(found, array[source])
    assert after.item("accessors", primitive["attributes"]["_COLOR_0"])["normalized"]
    moved = after.stored(primitive["targets"][0]["POSITION"])
    np.testing.assert_array_equal(moved, before.stored(target["POSITION"])[source])
    np.testing.assert_array_equal(after.stored(primitive["indices"])[:, 0], [1, 2, 3])
    np.testing.assert_allclose(
        after.array(primitive["attributes"]["TEXCOORD_1"]), unwrapping.uv, atol=1e-7
    )
    old, new = after.document["materials"]
    assert primitive["material"] == 1
    assert new["pbrMetallicRoughness"] == {
        "baseColorFactor": [1, 1, 1, 0.5],
        "baseColorTexture": {"index": 1, "texCoord": 1},
        "metallicFactor": 0.3,
    }
    assert new["extensions"] == {"KHR_other": {}}
    for kept in ("alphaMode", "emissiveFactor", "normalTexture"):
        assert new[kept] == old[kept]
    assert len(whole.points) == 3


def test_uvs_that_are_kept_change_no_vertex(tmp_path: Path) -> None:
    path = tmp_path / "uv.glb"
    box = trimesh.creation.box()
    uv = np.random.default_rng(1).random((len(box.vertices), 2))
    box.visual = trimesh.visual.TextureVisuals(uv=uv)
    box.export(path)
    mesh = read_mesh(path)
    (surface,) = mesh.surfaces
    assert surface.uv is not None
    before = Glb.read(path).document["meshes"][0]["primitives"][0]
    kept = Unwrapping(surface.faces, surface.uv)
    after = Glb.read(textured(tmp_path, mesh, [kept]))
    primitive = after.document["meshes"][0]["primitives"][0]
    assert primitive["attributes"] == before["attributes"]
    assert primitive["indices"] == before["indices"]
    material = after.document["materials"][primitive["material"]]
    assert material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] == 0


@pytest.mark.parametrize("up", ["y", "z"])
def test_vertex_colours_are_written_with_the_axes_of_the_file(tmp_path: Path, up: str) -> None:
    box = trimesh.creation.box((1, 2, 3))
    box.export(tmp_path / "box.ply")
    mesh = read_mesh(tmp_path / "box.ply", up)  # type: ignore[arg-type]
    colour = np.arange(24, dtype=np.uint8).reshape(8, 3)
    write_coloured(tmp_path / "coloured.ply", mesh, [colour])
    written = trimesh.load_mesh(tmp_path / "coloured.ply", process=False)
    np.testing.assert_allclose(written.vertices, box.vertices, atol=1e-6)
    np.testing.assert_array_equal(written.visual.vertex_colors[:, :3], colour)


def pictured(plain: Path, change: Callable[[Glb], object]) -> Path:
    """The file with UVs, a picture, and what a change makes of it."""
    mesh = read_mesh(plain)
    path = textured(plain.parent, mesh)
    glb = Glb.read(path)
    change(glb)
    glb.write(path)
    return path


def test_a_picture_that_is_text_in_the_file_is_read(plain: Path) -> None:
    def change(glb: Glb) -> None:
        uri = "data:image/png;base64," + base64.b64encode(png((9, 99, 199))).decode()
        glb.document["images"] = [{"uri": uri}]

    (colour,) = base_colours(read_mesh(pictured(plain, change)))
    expected = srgb_to_linear(np.array([9, 99, 199]) / 255)
    np.testing.assert_allclose(colour.picture[0, 0], expected, rtol=1e-6)


def test_a_picture_of_another_format_is_found_beside_its_extension(plain: Path) -> None:
    def change(glb: Glb) -> None:
        stream = io.BytesIO()
        Image.new("RGB", (4, 4), (9, 99, 199)).save(stream, "WEBP", lossless=True)
        glb.items("images").append({"bufferView": glb.add_bytes(stream.getvalue())})
        glb.document["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 1}}}]

    (colour,) = base_colours(read_mesh(pictured(plain, change)))
    expected = srgb_to_linear(np.array([9, 99, 199]) / 255)
    np.testing.assert_allclose(colour.picture[0, 0], expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("image", "line"),
    [
        ({"uri": "wood.png"}, r"outside the file \(wood\.png\)"),
        ({"uri": "data:,%abKTX 20"}, "kind that is not read .*graphics cards"),
        ({"uri": "data:;base64,iVBORw0KGgo="}, "picture in it"),
        ({"uri": None}, "damaged"),
    ],
)
def test_a_picture_that_cannot_be_read_is_said(
    plain: Path, image: dict[str, Any], line: str
) -> None:
    path = pictured(plain, lambda glb: glb.document.update(images=[image]))
    with pytest.raises(FileFormatError, match=line):
        base_colours(read_mesh(path))


def test_a_texture_without_a_picture_is_damage(plain: Path) -> None:
    path = pictured(plain, lambda glb: glb.document.update(textures=[{"extensions": {"X": {}}}]))
    with pytest.raises(FileFormatError, match="damaged"):
        base_colours(read_mesh(path))


def test_uvs_go_where_the_transform_of_a_texture_puts_them(plain: Path) -> None:
    transform = {"offset": [0.25, 0.5], "rotation": np.pi / 2, "scale": [0.5, 2]}

    def change(glb: Glb) -> None:
        info = glb.document["materials"][-1]["pbrMetallicRoughness"]["baseColorTexture"]
        info["extensions"] = {"KHR_texture_transform": transform}

    (colour,) = base_colours(read_mesh(pictured(plain, change)))
    # A quarter turn anticlockwise where v goes down: (1, 0) is turned to (0, −1).
    np.testing.assert_allclose(colour.uv[:3], [[0.25, 0.5], [0.25, 0], [2.25, 0.5]], atol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        {"scale": "11"},
        {"scale": ["1", "1"]},
        {"scale": [1]},
        {"scale": [1e308, 1e308]},
        {"offset": 5},
        {"offset": [1e30, 0]},
        {"rotation": "1"},
        {"rotation": None},
        {"texCoord": -1},
        {"texCoord": "0"},
    ],
    ids=str,
)
def test_a_transform_that_is_none_is_damage(plain: Path, change: dict[str, Any]) -> None:
    def damage(glb: Glb) -> None:
        info = glb.document["materials"][-1]["pbrMetallicRoughness"]["baseColorTexture"]
        info["extensions"] = {"KHR_texture_transform": change}

    with pytest.raises(FileFormatError, match="damaged"):
        base_colours(read_mesh(pictured(plain, damage)))


@pytest.mark.parametrize(
    "factor", ["1111", [1, 1, 1], ["1", "1", "1", "1"], None, 1, [[1, 1, 1, 1]]], ids=str
)
def test_a_colour_that_is_none_is_damage_to_who_reads_and_to_who_writes(
    plain: Path, factor: Any
) -> None:
    def damage(glb: Glb) -> None:
        glb.document["materials"][-1]["pbrMetallicRoughness"]["baseColorFactor"] = factor

    mesh = read_mesh(pictured(plain, damage))
    with pytest.raises(FileFormatError, match="`baseColorFactor` should be 4 finite numbers"):
        base_colours(mesh)
    with pytest.raises(FileFormatError, match="`baseColorFactor` should be 4 finite numbers"):
        put_on(mesh, split(mesh), png())


@pytest.mark.parametrize(
    "change",
    [
        lambda glb: glb.document["materials"].__setitem__(-1, {"pbrMetallicRoughness": 1}),
        lambda glb: glb.document["materials"].__setitem__(-1, {"extensions": 1}),
        lambda glb: primitive_of(glb).update(material=[0]),
        lambda glb: primitive_of(glb).update(material=False),
        lambda glb: primitive_of(glb).update(targets={"POSITION": 0}),
        lambda glb: primitive_of(glb).update(targets=[{"POSITION": "0"}]),
        lambda glb: primitive_of(glb).update(targets=[{"POSITION": not_finite(glb)}]),
    ],
    ids=range(7),
)
def test_who_writes_a_texture_into_a_damaged_document_is_told(
    plain: Path, change: Callable[[Glb], object]
) -> None:
    mesh = read_mesh(pictured(plain, change))
    moved = [replace(each, source=np.roll(each.source, 1)) for each in split(mesh)]
    with pytest.raises(FileFormatError, match="damaged"):
        textured(plain.parent, mesh, moved)


def primitive_of(glb: Glb) -> dict[str, Any]:
    return glb.document["meshes"][0]["primitives"][0]


def not_finite(glb: Glb) -> int:
    count = glb.document["accessors"][primitive_of(glb)["attributes"]["POSITION"]]["count"]
    return glb.add_array(np.full((count, 3), np.nan, "<f4"))


def test_uvs_of_another_number_than_vertices_are_damage(plain: Path) -> None:
    def change(glb: Glb) -> None:
        attributes = primitive_of(glb)["attributes"]
        attributes["TEXCOORD_1"] = glb.add_array(np.zeros((2, 2), "<f4"))
        info = glb.document["materials"][-1]["pbrMetallicRoughness"]["baseColorTexture"]
        info["texCoord"] = 1

    with pytest.raises(FileFormatError, match="as many UVs as vertices"):
        base_colours(read_mesh(pictured(plain, change)))


def test_split_vertices_stay_quantised(tmp_path: Path) -> None:
    glb = Glb(tmp_path, {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}]})
    corners = np.array([[0, 0, 0], [999, 0, 0], [0, 999, 0], [0, 0, 999]], "<u2")
    attributes = {"POSITION": glb.add_array(corners, bounds=True)}
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], "u1").reshape(-1, 1)
    primitive = {"attributes": attributes, "indices": glb.add_array(faces)}
    glb.document["meshes"] = [{"primitives": [primitive]}]
    glb.document["nodes"] = [{"mesh": 0}]
    glb.write(tmp_path / "q.glb")
    path = textured(tmp_path, read_mesh(tmp_path / "q.glb"))
    (shape,) = trimesh.load_scene(path).geometry.values()
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), 999)
    assert Glb.read(path).stored(attributes["POSITION"]).dtype == "<u2"
    again = read_mesh(path).surfaces[0]
    assert len(again.points) == 12
