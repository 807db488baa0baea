"""The base colour of a mesh: put a picture on it, read the one it has, write vertex colours."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import FileFormatError
from vnca.core.files import whole_file
from vnca.core.records import number, numbers, whole
from vnca.io.mesh import TO_OURS, TRIANGLES, Mesh, Surface, trimesh_for
from vnca.io.mesh.glb import DAMAGE, Glb
from vnca.io.picture import FORMATS, kind_of

# Of samplers, as OpenGL numbers them.
_LINEAR, _MIPMAPS, _CLAMPED = 9729, 9987, 33071
_FARTHEST = 2.0**30  # Times the width of any picture, a whole number that int64 holds.
_WHITE = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Unwrapping:
    """Where a surface lies in a texture.

    Attributes:
        faces: `[f, 3]`, rows of `uv`, in the order of the surface's faces.
        uv: `[w, 2]` in [0, 1], v downwards.
        source: `[w]`, the vertex of the surface that each row is a copy of; None where the UV
            set is the surface's own.
    """

    faces: AnyArray
    uv: AnyArray
    source: AnyArray | None = None


@dataclass(frozen=True, eq=False)
class BaseColour:
    """The base colour of a surface.

    Attributes:
        uv: `[v, 2]`, v downwards.
        picture: Linear RGB `[r, c, 3]`.
        repeats: Whether the picture goes on beyond its border; else its last texels do.
    """

    uv: AnyArray
    picture: FloatArray
    repeats: bool


def put_on(
    mesh: Mesh, unwrappings: Sequence[Unwrapping], png: bytes, *, roughness: float = 0.8
) -> None:
    """Give the document of a mesh a base colour texture; the rest of it stays.

    Each surface gets a copy of its material with the texture, and its own material stays in the
    list. New UV sets are added behind those that are there. Vertex colours would tint the
    texture: they are kept under the name `_COLOR_0`.

    Args:
        mesh: Changed in place.
        unwrappings: One a surface.
        png: The picture.
        roughness: Of surfaces without a material of their own.

    Raises:
        FileFormatError: If the materials or attributes of the file are damaged.
    """
    try:
        _put_on(mesh, unwrappings, png, roughness)
    except DAMAGE as error:
        raise FileFormatError(
            f"{mesh.glb.path}: damaged, it cannot be given a texture ({error})"
        ) from error


def _put_on(mesh: Mesh, unwrappings: Sequence[Unwrapping], png: bytes, roughness: float) -> None:
    glb = mesh.glb
    glb.items("images").append(
        {"name": "vnca", "mimeType": "image/png", "bufferView": glb.add_bytes(png)}
    )
    glb.items("samplers").append(
        {"magFilter": _LINEAR, "minFilter": _MIPMAPS, "wrapS": _CLAMPED, "wrapT": _CLAMPED}
    )
    glb.items("textures").append(
        {"sampler": len(glb.items("samplers")) - 1, "source": len(glb.items("images")) - 1}
    )
    texture = len(glb.items("textures")) - 1
    materials: dict[tuple[int | None, int], int] = {}
    for surface, unwrapping in zip(mesh.surfaces, unwrappings, strict=True):
        primitive = surface.primitive
        uv_set = 0 if unwrapping.source is None else _add_uv_set(glb, primitive, unwrapping)
        attributes = primitive["attributes"]
        if "COLOR_0" in attributes:
            attributes["_COLOR_0"] = attributes.pop("COLOR_0")
        key = (primitive.get("material"), uv_set)
        if key not in materials:
            material = _material(glb, key[0], {"index": texture, "texCoord": uv_set}, roughness)
            glb.items("materials").append(material)
            materials[key] = len(glb.items("materials")) - 1
        primitive["material"] = materials[key]


def base_colours(mesh: Mesh) -> list[BaseColour]:
    """The base colour of each surface; one of a single colour has a picture of one pixel.

    Raises:
        FileFormatError: If the file is damaged, or a picture is not in it.
    """
    pictures: dict[int, FloatArray] = {}
    try:
        return [_base_colour(mesh.glb, surface, pictures) for surface in mesh.surfaces]
    except DAMAGE as error:
        raise FileFormatError(
            f"{mesh.glb.path}: damaged, its materials cannot be read ({error})"
        ) from error


def write_coloured(path: Path, mesh: Mesh, colours: Sequence[AnyArray]) -> None:
    """Write the surfaces of a mesh as PLY with vertex colours, with the file's axes.

    Args:
        path: The `.ply` file.
        mesh: Its world positions are written.
        colours: For each surface, sRGB `[v, 3]`, uint8.

    Raises:
        OutputError: If it cannot be written.
        BackendUnavailableError: If trimesh is not installed.
    """
    trimesh = trimesh_for(path)
    parts = []
    for surface, colour in zip(mesh.surfaces, colours, strict=True):
        points = surface.points if mesh.up == "z" else surface.points @ TO_OURS
        parts.append(trimesh.Trimesh(points, surface.faces, vertex_colors=colour, process=False))
    data = trimesh.util.concatenate(parts).export(file_type="ply")
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def _add_uv_set(glb: Glb, primitive: dict[str, Any], unwrapping: Unwrapping) -> int:
    """Split the vertices along the seams and add the UVs; the number of the set is returned."""
    attributes, source = primitive["attributes"], unwrapping.source
    assert source is not None
    if not np.array_equal(source, np.arange(len(glb.stored(attributes["POSITION"])))):
        for place in (attributes, *primitive.get("targets", [])):
            for name, accessor in place.items():
                values = glb.stored(accessor)[source]
                place[name] = glb.add_array(values, accessor, bounds=name == "POSITION")
    faces = unwrapping.faces.astype(np.uint32).reshape(-1, 1)
    primitive["indices"] = glb.add_array(faces)
    primitive["mode"] = TRIANGLES
    uv_set = sum(name.startswith("TEXCOORD_") for name in attributes)
    attributes[f"TEXCOORD_{uv_set}"] = glb.add_array(unwrapping.uv.astype(np.float32))
    return uv_set


def _material(
    glb: Glb, original: int | None, texture: dict[str, int], roughness: float
) -> dict[str, Any]:
    """A copy of a material with the texture as its base colour."""
    if original is None:
        return {
            "name": "vnca",
            "doubleSided": True,  # A mesh that is inside out is textured all the same.
            "pbrMetallicRoughness": {
                "baseColorTexture": texture, "metallicFactor": 0.0, "roughnessFactor": roughness,
            },
        }  # fmt: skip
    material = dict(glb.item("materials", original))
    shading = dict(material.get("pbrMetallicRoughness", {}))
    opacity = float(numbers(shading, "baseColorFactor", _WHITE)[3])
    shading |= {"baseColorTexture": texture, "baseColorFactor": [1.0, 1.0, 1.0, opacity]}
    material |= {
        "name": f"{material.get('name') or f'material {original}'} (vnca)",
        "pbrMetallicRoughness": shading,
    }
    # An older way to say the base colour, which would win over this one.
    extensions = dict(material.get("extensions", {}))
    if extensions.pop("KHR_materials_pbrSpecularGlossiness", None) is not None:
        material["extensions"] = extensions
    return material


def _base_colour(glb: Glb, surface: Surface, pictures: dict[int, FloatArray]) -> BaseColour:
    material = surface.primitive.get("material")
    shading = glb.item("materials", material) if material is not None else {}
    shading = shading.get("pbrMetallicRoughness", {})
    factor = np.clip(numbers(shading, "baseColorFactor", _WHITE)[:3], 0, 1).astype(np.float32)
    texture = shading.get("baseColorTexture")
    if texture is None:
        return BaseColour(np.zeros((len(surface.points), 2)), factor.reshape(1, 1, 3), True)
    transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
    uv_set = whole(transform, "texCoord", whole(texture, "texCoord", 0))
    stored = glb.array(surface.primitive["attributes"][f"TEXCOORD_{uv_set}"])
    if stored.shape != (len(surface.points), 2):
        raise ValueError("as many UVs as vertices are needed")
    uv = _moved(stored, transform)
    if not (np.abs(uv[surface.faces]) <= _FARTHEST).all():  # Nor is a NaN.
        raise ValueError("UVs that are no places in a picture")
    entry = glb.item("textures", texture["index"])
    # Extensions name pictures of other formats, which may stand beside a usual one.
    sources = [entry, *entry.get("extensions", {}).values()]
    source = next((each for each in sources if "source" in each), entry)["source"]
    if source not in pictures:
        pictures[source] = _decoded(glb, glb.picture(source))
    sampler = glb.item("samplers", entry["sampler"]) if "sampler" in entry else {}
    return BaseColour(uv, pictures[source] * factor, sampler.get("wrapS") != _CLAMPED)


def _moved(uv: AnyArray, transform: dict[str, Any]) -> AnyArray:
    """UVs where a texture's transform puts them.

    Reference: Khronos, glTF extension KHR_texture_transform.
    """
    turn = number(transform, "rotation", 0.0)
    c, s = np.cos(turn), np.sin(turn)
    with np.errstate(over="ignore", invalid="ignore"):  # refused where it is used
        scaled = uv * numbers(transform, "scale", (1.0, 1.0))
        return scaled @ np.array([[c, -s], [s, c]]) + numbers(transform, "offset", (0.0, 0.0))


def _decoded(glb: Glb, data: bytes) -> FloatArray:
    try:
        with Image.open(io.BytesIO(data), formats=FORMATS) as image:
            pixels = np.asarray(image.convert("RGB"))
    except Image.UnidentifiedImageError as error:
        raise FileFormatError(
            f"{glb.path}: a picture in it is of a kind that is not read ({kind_of(data)})"
        ) from error
    except Exception as error:  # Decoders raise whatever a damaged file makes them trip over.
        raise FileFormatError(f"{glb.path}: a picture in it is damaged ({error})") from error
    return srgb_to_linear(pixels.astype(np.float32) / 255)
