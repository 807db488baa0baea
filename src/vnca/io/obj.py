"""Wavefront OBJ, made plain for a reader that knows triangles only.

Reference: Wavefront, Object Files (.obj), version 3.0.
"""

import re

import numpy as np

from vnca.io.polygons import triangulated

_DATA = re.compile(rb"^[ \t]*(v[tn]?|f)[ \t]+", re.MULTILINE)
_NOT_PLAIN = re.compile(rb"^f (?:[^\n#]*\s-|(?:[^\s#]+[ \t]+){3}[^\s#])|^f -", re.MULTILINE)


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
