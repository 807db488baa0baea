"""Fuzzing of meshes: GLB, and by their first bytes PLY, STL and OBJ.

An input of a GLB file is its JSON and its binary block; what is around them is built here.
"""

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import atheris
import numpy as np
import trimesh
from harness import fuzz
from PIL import Image

with atheris.instrument_imports(include=["vnca"]):
    from vnca.io.glb import Glb
    from vnca.io.mesh import read_mesh
    from vnca.io.mesh_texture import base_colours

_BETWEEN = b"\0\0\0\0"
_SUFFIXES = {b"glTF": ".glb", b"ply": ".ply", b"solid": ".stl", b"STL": ".stl", b"v ": ".obj"}
_PIXELS = 2**14


def build(data: bytes) -> bytes:
    """The file; of JSON, a GLB file of it."""
    if not data.startswith(b"{"):
        return data
    text, _, blob = data.partition(_BETWEEN)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + bytes(-len(text) % 4)
    chunks += struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def read(path: Path) -> None:
    """Read a mesh and the pictures on it."""
    with path.open("rb") as file:
        start = file.read(5)
    suffix = next((s for first, s in _SUFFIXES.items() if start.startswith(first)), ".glb")
    mesh = read_mesh(path.rename(path.with_suffix(suffix)))
    assert mesh.face_count > 0
    base_colours(mesh)


def limit(size: int) -> int:
    """JSON, vertices in double precision, and a picture."""
    return 64 * size + 16 * _PIXELS


def seeds() -> Iterator[bytes]:
    """A coloured tetrahedron in every format."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint16)
    for suffix in ("ply", "stl", "obj"):
        content = trimesh.Trimesh(points, faces, process=False).export(file_type=suffix)
        content = content.encode() if isinstance(content, str) else content
        yield {"ply": content, "stl": b"STL" + content[3:], "obj": content[content.find(b"v ") :]}[
            suffix
        ]
    picture = BytesIO()
    Image.new("RGB", (2, 2), (9, 99, 199)).save(picture, "PNG")
    glb = Glb(Path("seed"), {"asset": {"version": "2.0"}})
    glb.items("images").append({"bufferView": glb.add_bytes(picture.getvalue())})
    glb.items("textures").append({"source": 0})
    glb.items("materials").append({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    attributes = {"POSITION": glb.add_array(points), "TEXCOORD_0": glb.add_array(points[:, :2])}
    glb.items("meshes").append(
        {
            "primitives": [
                {
                    "attributes": attributes,
                    "indices": glb.add_array(faces.reshape(-1, 1)),
                    "material": 0,
                },
                {"attributes": attributes, "mode": 5},
                {"attributes": attributes, "mode": 6},
            ]
        }
    )
    glb.items("nodes").append({"children": [1], "rotation": [0, 0, 0, 1], "scale": [2, 2, 2]})
    glb.items("nodes").append({"mesh": 0, "matrix": np.eye(4).ravel().tolist()})
    glb.items("scenes").append({"nodes": [0]})
    content = glb.to_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    yield content
    yield content[20 : 20 + length] + _BETWEEN + content[28 + length :]


if __name__ == "__main__":
    Image.MAX_IMAGE_PIXELS = _PIXELS
    fuzz(
        "mesh", suffix=".mesh", build=build, read=read, limit=limit, seeds=seeds(), between=_BETWEEN
    )
