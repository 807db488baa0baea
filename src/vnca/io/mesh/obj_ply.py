"""Meshes in OBJ and PLY files, as far as trimesh does not read them right.

Their polygons, concave ones too, become triangles.

Reference: Wavefront, Object Files (.obj), version 3.0; Turk 1994, The PLY Polygon File Format.
"""

import re
from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import BackendUnavailableError

_ROUNDING = 1e-12
"""Share of a polygon's area by which a triangle may seem turned over."""
_STARTS = 8
"""Corners around which a fan is tried: one of them will do for most polygons, and for all quads."""


def triangulated(points: AnyArray, counts: AnyArray, corners: AnyArray) -> AnyArray:
    """Triangles that cover polygons, each wound as its polygon is.

    A polygon that its triangles around one of the first corners cover is a fan of these; any other
    is triangulated in the plane that fits it best. Polygons of fewer than three corners are
    dropped; of others no corner is.

    Args:
        points: `[v, 3]`.
        counts: `[p]`, corners of each polygon.
        corners: `[c]`, rows of `points`, polygon by polygon.

    Returns:
        `[t, 3]`, rows of `corners`, in the order of the polygons.

    Raises:
        ValueError: If a corner is not among the points.
        BackendUnavailableError: If mapbox-earcut is needed and not installed.
    """
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        raise ValueError("a face has a vertex that is not there")
    counts = np.asarray(counts, np.int64)
    starts = np.cumsum(counts) - counts
    triangles, polygon = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        left = np.flatnonzero(counts == count)
        for first in range(min(count, _STARTS)):
            ring = np.roll(np.arange(count), -first)
            rings = starts[left, None] + ring
            covered = _covered(points[corners[rings]]) if count > 3 else np.ones(len(left), bool)
            triangles.append(rings[covered][:, _fan(count)].reshape(-1, 3))
            polygon.append(np.repeat(left[covered], count - 2))
            left = left[~covered]
            if not len(left):
                break
        for this in left:
            ring = starts[this] + np.arange(count)
            # A quad that no fan covers crosses itself.
            cut = _cut(points[corners[ring]]) if count > 4 else _fan(count)
            triangles.append(ring[cut])
            polygon.append(np.full(len(cut), this))
    order = np.argsort(np.concatenate(polygon), kind="stable")
    return np.concatenate(triangles)[order]


def _fan(count: int) -> AnyArray:
    """`[count - 2, 3]`: triangles around the first corner."""
    second = np.arange(1, count - 1)
    return np.stack([np.zeros_like(second), second, second + 1], 1)


def _covered(rings: AnyArray) -> AnyArray:
    """Whether triangles around the first corner cover polygons `[p, n, 3]`, each once.

    Where none is turned over, none lies outside the polygon.
    """
    normals = _fan_normals(rings)
    whole = normals.sum(1)
    along = np.einsum("pkc,pc->pk", normals, whole)
    return (along >= -_ROUNDING * (whole**2).sum(1)[:, None]).all(1)


def _fan_normals(rings: AnyArray) -> AnyArray:
    """`[p, n - 2, 3]`, twice as long as the areas; their sum is Newell's normal of the polygon.

    Reference: Sutherland, Sproull and Schumacker 1974.
    """
    rays = rings[:, 1:] - rings[:, :1]
    return np.cross(rays[:, :-1], rays[:, 1:])


def _cut(ring: AnyArray) -> AnyArray:
    """Triangles `[n - 2, 3]` of one polygon `[n, 3]`, in the plane that fits it best."""
    try:
        from mapbox_earcut import triangulate_float64
    except ImportError as error:
        raise BackendUnavailableError(
            "a mesh with concave polygons needs mapbox-earcut: pip install 'vnca[texture]'"
        ) from error
    flat = _flattened(ring, _fan_normals(ring[None])[0].sum(0))
    # Without a plane there is no inside either: any triangles will do.
    if flat is None:
        return _fan(len(ring))
    cut = triangulate_float64(flat, np.array([len(ring)], np.uint32)).reshape(-1, 3).astype(int)
    if not len(cut):
        return _fan(len(ring))
    a, b, c = flat[cut].transpose(1, 2, 0)
    turned = (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])
    cut[turned] = cut[turned, ::-1]
    return np.concatenate([cut, _left_out(np.unique(cut), len(ring))])


def _left_out(used: AnyArray, count: int) -> AnyArray:
    """Triangles between the corners in use and those beside them that are not.

    Corners on a straight side are left out; in space, where the polygon is bent, they may stand
    out of it, and the polygons beside it have them.
    """
    found = [np.empty((0, 3), np.int64)]
    for before, after in zip(used, np.append(used[1:], used[0] + count), strict=True):
        chain = np.arange(before, after + 1) % count
        if len(chain) > 2:
            found.append(chain[_fan(len(chain))])
    return np.concatenate(found)


def _flattened(ring: AnyArray, normal: AnyArray) -> AnyArray | None:
    """`[n, 2]`, anticlockwise and at most a unit wide, if the polygon has a plane."""
    extent = np.ptp(ring, axis=0).max()
    length = np.linalg.norm(normal)
    if not (np.isfinite(extent) and np.isfinite(length) and length > 0):
        return None
    up = normal / length
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    return np.ascontiguousarray(
        (ring - ring[0]) / extent @ np.stack([right, np.cross(up, right)]).T
    )


_DATA = re.compile(rb"^[ \t]*(v[tn]?|f)[ \t]+", re.MULTILINE)
_NOT_PLAIN = re.compile(rb"^f (?:[^\n#]*\s-|(?:[^\s#]+[ \t]+){3}[^\s#])|^f -", re.MULTILINE)
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "text"}
_UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))


def plain_obj(data: bytes) -> bytes:
    """The file with triangles in place of polygons, and numbers that count from the beginning.

    A corner may also be told by how far back its vertex is, counted from the line of the face:
    readers that count from the end of the file take another one. All that is not about faces
    stays as it is.

    Raises:
        ValueError: If faces cannot be understood.
        BackendUnavailableError: If concave polygons are in it and mapbox-earcut is not installed.
    """
    text = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
    text = _DATA.sub(rb"\1 ", text)
    if not _NOT_PLAIN.search(text):
        return text
    lines = text.split(b"\n")
    # Vertices, and the UVs and normals that a corner names after its vertex.
    before = {b"v": 0, b"vt": 0, b"vn": 0}
    points: list[list[float]] = []
    places: list[int] = []
    faces: list[list[bytes]] = []
    for place, line in enumerate(lines):
        kind, _, rest = line.partition(b" ")
        if kind == b"f":
            places.append(place)
            counted = tuple(before.values())
            faces.append([_absolute(corner, counted) for corner in rest.partition(b"#")[0].split()])
        elif kind in before:
            before[kind] += 1
            if kind == b"v":
                points.append([float(number) for number in rest.split()[:3]])
    corners = [corner for face in faces for corner in face]
    counts = np.array([len(face) for face in faces], np.int64)
    vertices = np.array([int(corner.partition(b"/")[0]) for corner in corners], np.int64) - 1
    triangles = triangulated(np.array(points, np.float64).reshape(-1, 3), counts, vertices)
    for place in places:
        lines[place] = b""
    of = np.searchsorted(np.cumsum(counts), triangles[:, 0], "right")
    for face, (a, b, c) in zip(of.tolist(), triangles.tolist(), strict=True):
        lines[places[face]] += b"f %b %b %b\n" % (corners[a], corners[b], corners[c])
    return b"\n".join(lines)


def _absolute(corner: bytes, counted: tuple[int, ...]) -> bytes:
    """`v/vt/vn` with numbers that count from the beginning of the file."""
    if b"-" not in corner:
        return corner
    return b"/".join(
        b"%d" % (before + 1 + int(number)) if number.startswith(b"-") else number
        for number, before in zip(corner.split(b"/"), counted, strict=False)
    )


@dataclass(frozen=True, eq=False)
class PlyMesh:
    """The triangles of a PLY file.

    Attributes:
        points: `[v, 3]`, float64.
        faces: `[f, 3]`, rows of `points`.
        normals: `[v, 3]`, or None.
        uv: `[v, 2]`, v upwards, or None.
        colours: `[v, 3]`, as stored, or None.
        picture: Name of the file of its texture, or None.
    """

    points: AnyArray
    faces: AnyArray
    normals: AnyArray | None
    uv: AnyArray | None
    colours: AnyArray | None
    picture: str | None


@dataclass(frozen=True, eq=False)
class _Property:
    name: str
    kind: np.dtype
    length: np.dtype | None
    """Of a list: the type of its length."""


@dataclass(frozen=True, eq=False)
class _Lists:
    counts: AnyArray
    values: AnyArray


@dataclass(frozen=True, eq=False)
class _Element:
    name: str
    count: int
    properties: list[_Property]


def parse_ply(data: bytes) -> PlyMesh:
    """The triangles in the bytes of a PLY file.

    Corners of one vertex that differ in their UVs become vertices of their own.

    Raises:
        ValueError: If the file is damaged.
        BackendUnavailableError: If concave polygons are in it and mapbox-earcut is not installed.
    """
    elements, picture, body = _header(data)
    at, found = 0, {}
    for element in elements:
        found[element.name], at = _columns(element, body, at)
    vertices, polygons = found.get("vertex", {}), found.get("face", {})
    points = _table(vertices, ("x", "y", "z"))
    if points is None:
        raise ValueError("it has no vertices")
    points = points.astype(np.float64)
    normals = _table(vertices, ("nx", "ny", "nz"))
    colours = _table(vertices, ("red", "green", "blue"))
    uv = next((uv for names in _UV if (uv := _table(vertices, names)) is not None), None)
    corners = polygons.get("vertex_indices", polygons.get("vertex_index"))
    if not isinstance(corners, _Lists):
        return PlyMesh(points, np.empty((0, 3), np.int64), normals, uv, colours, picture)
    rows = corners.values.astype(np.int64)
    triangles = triangulated(points, corners.counts, rows)
    faces = rows[triangles]
    of_corners = polygons.get("texcoord")
    if isinstance(of_corners, _Lists) and np.array_equal(of_corners.counts, 2 * corners.counts):
        uv = of_corners.values.reshape(-1, 2)[triangles.ravel()]
        apart = np.column_stack([faces.ravel(), uv]).astype(np.float64)
        _, first, inverse = np.unique(apart, axis=0, return_index=True, return_inverse=True)
        source, uv = faces.ravel()[first], uv[first]
        points, faces = points[source], inverse.reshape(-1, 3)
        normals, colours = _taken(normals, source), _taken(colours, source)
    return PlyMesh(points, faces, normals, uv, colours, picture)


def _taken(values: AnyArray | None, rows: AnyArray) -> AnyArray | None:
    return None if values is None else values[rows]


def _header(data: bytes) -> tuple[list[_Element], str | None, bytes]:
    """The elements, the name of a picture, and the bytes of the elements; text becomes doubles."""
    text, end, body = data.partition(b"end_header")
    lines = [line.split() for line in text.decode("latin-1").splitlines()]
    if not end or lines[0] != ["ply"]:
        raise ValueError("its header cannot be read")
    order, picture = "", None
    elements: list[_Element] = []
    for words in lines[1:]:
        match words:
            case ["format", name, "1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, count]:
                elements.append(_Element(name, int(count), []))
            case ["property", "list", length, kind, name]:
                elements[-1].properties.append(
                    _Property(name, _dtype(kind, order), _dtype(length, order))
                )
            case ["property", kind, name]:
                elements[-1].properties.append(_Property(name, _dtype(kind, order), None))
            case ["comment", "TextureFile", *names]:
                picture = " ".join(names)
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"its header cannot be read at '{' '.join(words)}'")
    body = body.removeprefix(b"\r").removeprefix(b"\n")
    if order == "text":
        body = np.array(body.split(), np.float64).tobytes()
    return elements, picture, body


def _dtype(name: str, order: str) -> np.dtype:
    if name not in _TYPES:
        raise ValueError(f"its header names an unknown type '{name}'")
    return np.dtype("f8") if order == "text" else np.dtype(order + _TYPES[name])


def _columns(element: _Element, data: bytes, at: int) -> tuple[dict[str, AnyArray | _Lists], int]:
    """What an element holds from `at` on, and where it ends."""
    if element.count < 1 or not element.properties:
        return {}, at
    lengths, row = _row(element, data, at)
    if at + row * element.count <= len(data):
        fields = []
        for number, (each, length) in enumerate(zip(element.properties, lengths, strict=True)):
            if each.length is not None:
                fields.append((f"length {number}", each.length))
            fields.append((f"{number}", each.kind, () if each.length is None else (length,)))
        table = np.frombuffer(data, fields, element.count, at)
        listed = [n for n, each in enumerate(element.properties) if each.length is not None]
        if all((table[f"length {n}"] == lengths[n]).all() for n in listed):
            return {
                each.name: table[f"{n}"] if each.length is None else _Lists(
                    np.full(element.count, lengths[n]), table[f"{n}"].reshape(-1)
                )
                for n, each in enumerate(element.properties)
            }, at + row * element.count  # fmt: skip
    return _uneven_columns(element, data, at)


def _uneven_columns(
    element: _Element, data: bytes, at: int
) -> tuple[dict[str, AnyArray | _Lists], int]:
    """The same where the lists of a property differ in length, row by row."""
    pieces = [[] for _ in element.properties]
    counts = [[] for _ in element.properties]
    for _ in range(element.count):
        lengths, _ = _row(element, data, at)
        for each, length, its_pieces, its_counts in zip(
            element.properties, lengths, pieces, counts, strict=True
        ):
            at += each.length.itemsize if each.length is not None else 0
            end = at + length * each.kind.itemsize
            its_pieces.append(data[at:end])
            its_counts.append(length)
            at = end
    columns = {}
    for each, its_pieces, its_counts in zip(element.properties, pieces, counts, strict=True):
        values = np.frombuffer(b"".join(its_pieces), each.kind)
        columns[each.name] = values if each.length is None else _Lists(np.array(its_counts), values)
    return columns, at


def _row(element: _Element, data: bytes, at: int) -> tuple[list[int], int]:
    """How many values each property has in the row at `at`, and the bytes of the row."""
    start, lengths = at, []
    for each in element.properties:
        length = 1
        if each.length is not None:
            if at + each.length.itemsize > len(data):
                raise ValueError("it is cut off")
            length = int(np.frombuffer(data, each.length, 1, at)[0])
            at += each.length.itemsize
        if not 0 <= length * each.kind.itemsize <= len(data) - at:
            raise ValueError("it is cut off")
        at += length * each.kind.itemsize
        lengths.append(length)
    return lengths, at - start


def _table(columns: dict[str, AnyArray | _Lists], names: tuple[str, ...]) -> AnyArray | None:
    """Single values beside each other, `[n, names]`, if all of them are there."""
    found = [columns.get(name) for name in names]
    single = [column for column in found if isinstance(column, np.ndarray)]
    return np.stack(single, 1) if len(single) == len(names) else None
