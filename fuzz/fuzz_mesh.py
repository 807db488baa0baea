"""Fuzzing of meshes: GLB, and by their first bytes PLY, STL and OBJ.

An input of a GLB file is its JSON and its binary block; what is around them is built here.
"""

import json
import struct
from base64 import b64encode
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import atheris
import DracoPy
import numpy as np
import trimesh
from harness import fuzz
from PIL import Image

with atheris.instrument_imports(include=["vnca"]):
    from vnca.io.mesh import read_mesh
    from vnca.io.mesh.glb import Glb
    from vnca.io.mesh.texture import Unwrapping, base_colours, put_on

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
    """Read a mesh and the pictures on it, put another on it, and write it."""
    with path.open("rb") as file:
        start = file.read(5)
    suffix = next((s for first, s in _SUFFIXES.items() if start.startswith(first)), ".glb")
    mesh = read_mesh(path.rename(path.with_suffix(suffix)))
    assert mesh.face_count > 0
    base_colours(mesh)
    corners = [np.arange(surface.faces.size) for surface in mesh.surfaces]
    put_on(
        mesh,
        [
            Unwrapping(each.reshape(-1, 3), np.zeros((len(each), 2)), surface.faces.ravel())
            for each, surface in zip(corners, mesh.surfaces, strict=True)
        ],
        b"",
    )
    mesh.glb.to_bytes()


def limit(size: int) -> int:
    """JSON, vertices in double precision, and a picture."""
    return 64 * size + 16 * _PIXELS


def seeds() -> Iterator[bytes]:
    """A coloured tetrahedron in every format, and polygons where there may be some."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint16)
    for suffix in ("ply", "stl", "obj"):
        content = trimesh.Trimesh(points, faces, process=False).export(file_type=suffix)
        content = content.encode() if isinstance(content, str) else content
        yield {"ply": content, "stl": b"STL" + content[3:], "obj": content[content.find(b"v ") :]}[
            suffix
        ]
    yield b"v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 .5 0\nvt 0 0\nv 0 2 0\nf 1 2 3 4 5\nf -5/-1 -4/1 -3/1\n"
    for order in ("ascii", "binary_little_endian", "binary_big_endian"):
        yield _ply_seed(order)
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
    yield content
    yield _input(glb)
    (buffer,) = glb.items("buffers")
    chunk = content[28 + struct.unpack_from("<I", content, 12)[0] :]
    buffer["uri"] = "data:;base64," + b64encode(chunk).decode()
    yield json.dumps(glb.document).encode()
    yield _input(_draco_seed(points, faces))


def _input(glb: Glb) -> bytes:
    content = glb.to_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    return content[20 : 20 + length] + _BETWEEN + content[28 + length :]


def _ply_seed(order: str) -> bytes:
    """A concave polygon and a triangle, with UVs of corners."""
    header = f"ply\nformat {order} 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    header += "property float z\nelement face 2\nproperty list uchar int vertex_indices\n"
    header += "property list uchar float texcoord\nend_header\n"
    points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0)]
    rows = [("fff", point) for point in points]
    for face in ((0, 1, 2, 3, 4), (4, 2, 0)):
        uv = [0.5] * 2 * len(face)
        rows.append((f"B{len(face)}iB{len(uv)}f", (len(face), *face, len(uv), *uv)))
    if order == "ascii":
        return (header + "\n".join(" ".join(map(str, values)) for _, values in rows)).encode()
    sign = "<" if "little" in order else ">"
    return header.encode() + b"".join(struct.pack(sign + kinds, *values) for kinds, values in rows)


def _draco_seed(points: np.ndarray, faces: np.ndarray) -> Glb:
    glb = Glb(Path("seed"), {"asset": {"version": "2.0"}})
    data = DracoPy.encode(points, faces.astype(np.uint32), tex_coord=points[:, :2].astype(float))
    kinds = {each["attribute_type"]: each["unique_id"] for each in DracoPy.decode(data).attributes}
    glb.items("accessors").extend(
        {"componentType": 5126, "type": kind, "count": len(points)} for kind in ("VEC3", "VEC2")
    )
    extension = {
        "bufferView": glb.add_bytes(data),
        "attributes": {"POSITION": kinds[0], "TEXCOORD_0": kinds[3]},
    }
    primitive = {
        "attributes": {"POSITION": 0, "TEXCOORD_0": 1},
        "extensions": {"KHR_draco_mesh_compression": extension},
    }
    glb.items("meshes").append({"primitives": [primitive]})
    glb.items("nodes").append({"mesh": 0})
    return glb


if __name__ == "__main__":
    Image.MAX_IMAGE_PIXELS = _PIXELS
    fuzz(
        "mesh", suffix=".mesh", build=build, read=read, limit=limit, seeds=seeds(), between=_BETWEEN
    )
