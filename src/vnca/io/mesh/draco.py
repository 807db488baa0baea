"""Meshes that Draco compressed, made plain.

Reference: Khronos, glTF extension KHR_draco_mesh_compression.
"""

from typing import Any

import numpy as np

from vnca.core.errors import BackendUnavailableError, FileFormatError
from vnca.io.mesh.glb import DAMAGE, Glb

EXTENSION = "KHR_draco_mesh_compression"


def decompress(glb: Glb) -> None:
    """Put plain vertices and faces in place of compressed ones, in a document.

    Where the file holds plain ones too, those are kept.

    Raises:
        FileFormatError: If what is compressed cannot be read.
        BackendUnavailableError: If DracoPy is needed and not installed.
    """
    try:
        for mesh in glb.document.get("meshes", []):
            for primitive in mesh["primitives"]:
                compressed = primitive.get("extensions", {}).pop(EXTENSION, None)
                if compressed is None:
                    continue
                stored = [primitive["attributes"][name] for name in compressed["attributes"]]
                if not all("bufferView" in glb.item("accessors", each) for each in stored):
                    _decompress(glb, primitive, compressed)
                if not primitive["extensions"]:
                    del primitive["extensions"]
        glb.drop_extension(EXTENSION)
    except DAMAGE as error:
        raise FileFormatError(
            f"{glb.path}: damaged, its meshes cannot be decompressed ({error})"
        ) from error


def _decompress(glb: Glb, primitive: dict[str, Any], compressed: dict[str, Any]) -> None:
    decoded = _decoded(glb, compressed["bufferView"])
    stored = {each["unique_id"]: each["data"] for each in decoded.attributes}
    attributes = primitive["attributes"]
    for name, number in compressed["attributes"].items():
        like = attributes[name]
        values = np.asarray(stored[number])
        if len(values) != glb.item("accessors", like)["count"]:
            raise ValueError("another number of vertices than it says")
        attributes[name] = glb.add_array(
            values.astype(glb.type_of(like)), like, bounds=name == "POSITION"
        )
    faces = np.asarray(decoded.faces, np.uint32)
    if faces.size and faces.max() >= len(decoded.points):
        raise ValueError("a face has a vertex that is not there")
    primitive["indices"] = glb.add_array(faces.reshape(-1, 1))
    primitive.pop("mode", None)  # They are triangles, as where none is named.


def _decoded(glb: Glb, view: int) -> Any:
    try:
        import DracoPy
    except ImportError as error:
        raise BackendUnavailableError(
            f"{glb.path}: its meshes are compressed ({EXTENSION}), which needs DracoPy: "
            "pip install 'vnca[texture]'; or export it without"
        ) from error
    try:
        mesh = DracoPy.decode(glb.bytes_of(view))
    except DracoPy.FileTypeException as error:
        raise ValueError(str(error)) from error
    if not isinstance(mesh, DracoPy.DracoMesh):
        raise ValueError("points without faces")
    return mesh
