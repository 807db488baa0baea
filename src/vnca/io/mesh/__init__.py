"""Triangle meshes: what there is to texture in a file.

Every mesh is a GLB document, OBJ, PLY and STL after a conversion. So all that a GLB file holds
stays in it: nodes, materials, animations, further UV sets. Meshes that Draco compressed are made
plain.

Reference: Khronos, glTF extension KHR_draco_mesh_compression.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vnca.core import AnyArray
from vnca.core.errors import (
    BackendUnavailableError,
    FileFormatError,
    GridError,
    OptionError,
    VncaError,
)
from vnca.core.files import existing_file
from vnca.core.records import numbers
from vnca.io.mesh.glb import DAMAGE, Glb
from vnca.io.mesh.obj_ply import PlyMesh, parse_ply, plain_obj
from vnca.io.picture import FORMATS
from vnca.io.smoke_format import UpAxis

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


SUFFIXES = (".glb", ".obj", ".ply", ".stl")
"""What `read_mesh` reads."""
_UP: dict[str, UpAxis] = {".glb": "y", ".obj": "y", ".ply": "z", ".stl": "z"}
MOST_VERTICES = 2**25
"""Vertices of all surfaces together, which may share those of the file."""
TRIANGLES = 4
_STRIP, _FAN = 5, 6
# glTF has +y up: its (x, y, z) is our (x, −z, y), and a file with +z up is turned to lie so.
TO_OURS = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
_STAND_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]


@dataclass(frozen=True, eq=False)
class Surface:
    """The triangles of one primitive of a GLB document.

    Attributes:
        primitive: Its entry in the document.
        name: Of its mesh.
        points: `[v, 3]`, vertices in the world, +z up.
        faces: `[f, 3]`, rows of `points`.
        uv: `[v, 2]`, the first UV set with v downwards, or None.
    """

    primitive: dict[str, Any]
    name: str
    points: AnyArray
    faces: AnyArray
    uv: AnyArray | None


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh file.

    Attributes:
        glb: The document.
        surfaces: All its triangles that a scene shows, each once.
        up: The up axis of the file.
    """

    glb: Glb
    surfaces: list[Surface]
    up: UpAxis

    @property
    def bounds(self) -> tuple[AnyArray, AnyArray]:
        """Least and greatest corner, +z up."""
        used = [surface.points[np.unique(surface.faces)] for surface in self.surfaces]
        return np.min([p.min(0) for p in used], 0), np.max([p.max(0) for p in used], 0)

    @property
    def face_count(self) -> int:
        """Triangles in all surfaces."""
        return sum(len(surface.faces) for surface in self.surfaces)


def read_mesh(path: Path, up: UpAxis | None = None) -> Mesh:
    """Read a mesh: GLB, OBJ, PLY or STL.

    Args:
        path: The suffix decides the format.
        up: The file's up axis; by default y for OBJ, z for PLY and STL. GLB is always y.

    Raises:
        FileFormatError: If the file is missing, damaged, or of another format.
        GridError: If there is nothing to texture in it, or vertices are not finite.
        OptionError: If the up axis contradicts the format.
        BackendUnavailableError: If trimesh is needed and not installed.
    """
    suffix = existing_file(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FileFormatError(f"{path}: expected a mesh ({', '.join(SUFFIXES)})")
    up = up or _UP[suffix]
    if suffix == ".glb":
        if up != "y":
            raise OptionError(f"`up_axis` {up}: {path} is a GLB file, where up is always y")
        glb = Glb.read(path)
        decompress(glb)
    else:
        glb = _converted(path, up)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            surfaces = list(_surfaces(glb))
    except DAMAGE as error:
        raise FileFormatError(f"{path}: damaged, its meshes cannot be read ({error})") from error
    if not surfaces:
        raise GridError(f"{path}: there are no triangles in it to texture")
    mesh = Mesh(glb, surfaces, up)
    low, high = mesh.bounds
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise GridError(f"{path}: has vertices that are not finite numbers; repair the mesh first")
    if not (high > low).any():
        raise GridError(f"{path}: all its vertices are one point; there is no surface to texture")
    return mesh


def trimesh_for(path: Path) -> Any:
    """The package trimesh, or one line that says what needs it.

    Raises:
        BackendUnavailableError: If it is not installed.
    """
    try:
        import trimesh
    except ImportError as error:
        raise BackendUnavailableError(
            f"{path}: {path.suffix} meshes need trimesh: pip install 'vnca[texture]'"
        ) from error
    return trimesh


def _converted(path: Path, up: UpAxis) -> Glb:
    """The GLB document of a file of another format."""
    trimesh = trimesh_for(path)
    try:
        # What single precision cannot hold becomes infinite, and is refused as such.
        with np.errstate(over="ignore", invalid="ignore"):
            scene = _scene(path, trimesh)
            shapes = [s for s in scene.geometry.values() if isinstance(s, trimesh.Trimesh)]
            if not any(len(shape.faces) for shape in shapes):
                raise GridError(f"{path}: there are no triangles in it to texture")
            for shape in shapes:
                if len(shape.faces) and not 0 <= shape.faces.min() <= shape.faces.max() < len(
                    shape.vertices
                ):
                    raise ValueError("a face has a vertex that is not there")
                if path.suffix.lower() == ".stl":  # Each of its triangles has vertices of its own.
                    shape.merge_vertices()
            glb = Glb.parse(scene.export(file_type="glb"), path)
    except (VncaError, MemoryError):
        raise
    except Exception as error:  # Parsers raise whatever a damaged file makes them trip over.
        raise FileFormatError(f"{path}: the mesh is damaged ({error})") from error
    if up == "z":
        for scene in glb.items("scenes"):
            glb.items("nodes").append(
                {"name": "z up", "rotation": _STAND_UP, "children": scene["nodes"]}
            )
            scene["nodes"] = [len(glb.items("nodes")) - 1]
    return glb


def _scene(path: Path, trimesh: Any) -> Any:
    """The scene of a file that is not GLB, all its polygons triangles."""
    data, kind = path.read_bytes(), path.suffix[1:].lower()
    resolver = trimesh.resolvers.FilePathResolver(str(path))
    if kind == "ply":
        return trimesh.Scene({path.name: _ply_shape(parse_ply(data), resolver, trimesh)})
    if kind == "obj":
        data = plain_obj(data)
    return trimesh.load_scene(BytesIO(data), kind, process=False, resolver=resolver)


def _ply_shape(ply: PlyMesh, resolver: Any, trimesh: Any) -> Any:
    shape = trimesh.Trimesh(
        ply.points, ply.faces, vertex_normals=ply.normals, vertex_colors=ply.colours, process=False
    )
    if ply.uv is not None:
        picture = None
        if ply.picture is not None:
            # Without it the mesh can be textured all the same.
            with suppress(Exception):
                picture = Image.open(BytesIO(resolver.get(ply.picture)), formats=FORMATS)
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=picture)
        shape.visual = trimesh.visual.TextureVisuals(uv=ply.uv, material=material)
    return shape


def _surfaces(glb: Glb) -> Iterator[Surface]:
    vertices = 0
    for mesh, matrix in _placed_meshes(glb):
        entry = glb.item("meshes", mesh)
        for primitive in entry["primitives"]:
            mode = primitive.get("mode", TRIANGLES)
            if mode not in (TRIANGLES, _STRIP, _FAN) or "POSITION" not in primitive["attributes"]:
                continue
            points = glb.array(primitive["attributes"]["POSITION"])
            vertices += len(points)
            if vertices > MOST_VERTICES:
                raise ValueError(f"its parts have more than {MOST_VERTICES} vertices together")
            faces = _faces(glb, primitive, mode, len(points))
            if not len(faces):
                continue
            uv = None
            if "TEXCOORD_0" in primitive["attributes"]:
                uv = glb.array(primitive["attributes"]["TEXCOORD_0"])
                if uv.shape != (len(points), 2):
                    raise ValueError("as many UVs as vertices are needed")
            world = points @ matrix[:3, :3].T + matrix[:3, 3]
            name = str(entry.get("name") or f"mesh {mesh}")
            yield Surface(primitive, name, world @ TO_OURS.T, faces, uv)


def _faces(glb: Glb, primitive: dict[str, Any], mode: int, points: int) -> AnyArray:
    if "indices" in primitive:
        stored = glb.stored(primitive["indices"])
        if stored.shape[1] != 1 or stored.dtype.kind != "u":
            raise ValueError("indices of another type than unsigned numbers")
        order = stored[:, 0].astype(np.int64)
    else:
        order = np.arange(points)
    if len(order) and not 0 <= order.min() <= order.max() < points:
        raise ValueError("a face has a vertex that is not there")
    if mode == TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    if mode == _FAN:
        return np.stack([np.full(max(len(order) - 2, 0), order[0]), order[1:-1], order[2:]], 1)
    faces = np.stack([order[:-2], order[1:-1], order[2:]], 1)
    faces[1::2] = faces[1::2, ::-1]
    return faces


def _placed_meshes(glb: Glb) -> Iterator[tuple[int, AnyArray]]:
    """Meshes that a scene shows, each at its first place, with its 4×4 matrix to the world."""
    nodes, seen, visited = glb.items("nodes"), set(), set()
    roots = [node for scene in glb.items("scenes") for node in scene.get("nodes", [])]
    if not glb.items("scenes"):
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [node for node in range(len(nodes)) if node not in children]
    waiting = [(node, np.eye(4)) for node in reversed(roots)]
    while waiting:
        index, above = waiting.pop()
        node = glb.item("nodes", index)
        if index in visited:
            continue
        visited.add(index)
        matrix = above @ _local(node)
        waiting += [(child, matrix) for child in reversed(node.get("children", []))]
        mesh = node.get("mesh")
        if mesh is not None and mesh not in seen:
            seen.add(mesh)
            # A skinned mesh is placed by its bones alone, and unposed they leave it as it is.
            yield mesh, np.eye(4) if "skin" in node else matrix


def _local(node: dict[str, Any]) -> AnyArray:
    """The 4×4 matrix of a node to its parent.

    Reference: glTF 2.0, section 3.5.3.
    """
    if "matrix" in node:
        return numbers(node, "matrix", (0.0,) * 16).reshape(4, 4).T
    x, y, z, w = numbers(node, "rotation", (0.0, 0.0, 0.0, 1.0))
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turned * numbers(node, "scale", (1.0, 1.0, 1.0))
    matrix[:3, 3] = numbers(node, "translation", (0.0, 0.0, 0.0))
    return matrix
