"""Fuzzing of OpenVDB files: headers, trees, arrays, and the smoke they hold.

An input is a list of parts: what comes ahead of the first grid, then three for each grid, namely
names, head with topology, and values. The offsets between them are filled in here, unless the
input brings its own; and the file claims to have offsets, or not, as the input says.
"""

import struct
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import atheris
import blosc
import numpy as np
from harness import fuzz, lengthened, shortened

with atheris.instrument_imports(include=["vnca"]):
    from vnca.core import Box
    from vnca.io import SmokeFormat, read_smoke, vdb_smoke
    from vnca.io.vdb import VALUE_TYPES, Grid, Tiles, Transform, open_vdb, write_vdb
    from vnca.io.vdb.layout import Cursor, encode_string
    from vnca.io.vdb.metadata import Metadata, read_metadata

_BETWEEN = b"\xfe\xfd\xfe"
_AHEAD, _CLAIMS_OFFSETS = 57, 20  # bytes of the header, and which of them says that
_METADATA = ("class", "file_bbox_min", "file_bbox_max")
_REACH = Box((-9, -9, -9), (10, 10, 10))


def build(data: bytes) -> bytes:
    """The file; a grid whose names begin with an odd byte brings offsets of its own."""
    ahead, *parts = data.split(_BETWEEN)
    content = bytearray(lengthened(ahead))
    for names, head, values in zip(*[map(lengthened, parts)] * 3, strict=False):
        own, names = names[:1] > b"\x7f", names[1:]
        start = len(content) + len(names) + (0 if own else 24)
        blocks = start + len(head)
        content += names if own else names + struct.pack("<3q", start, blocks, blocks + len(values))
        content += head + values
    return bytes(content)


def taken_apart(content: bytes) -> bytes:
    """The input that `build` makes `content` of, but for most of its metadata."""
    cursor = Cursor(BytesIO(content), 0, len(content), "seed")
    cursor.take(_AHEAD)
    read_metadata(cursor)
    count = cursor.unpack("I")
    parts = [content[: cursor.position]]
    for _ in range(count):
        begin = cursor.position
        for _ in range(3):
            cursor.string()
        names = b"\0" + content[begin : cursor.position]
        start, blocks, end = cursor.unpack("3q")
        head = Cursor(BytesIO(content), start, blocks, "seed")
        packing, metadata = head.take(4), read_metadata(head)
        few = Metadata((name, metadata[name]) for name in _METADATA if name in metadata)
        parts += [names, packing + few.encode() + head.take(head.remaining), content[blocks:end]]
        cursor.seek(end)
    return _BETWEEN.join(map(shortened, parts))


def read(path: Path) -> None:
    """Read all of a file and write it again; or read it as smoke, whichever its size says."""
    if path.stat().st_size % 2:
        read_smoke(path, SmokeFormat())
        return
    with open_vdb(path) as file:
        for header in file.grids.values():
            if not header.is_readable:
                continue
            grid = header.read()
            grid.active_box()
            assert header.box is None or header.box.shape
            grid.to_dense(_REACH, fill=0)
        if len(file.metadata) == 1:
            write_vdb(path.with_suffix(".copy"), [*file.grids.values()], file.metadata, "none")


def limit(size: int) -> int:
    """A leaf or tile of equal values is packed into some hundredth of what it is in memory."""
    return 64 * size


def seeds() -> Iterator[bytes]:
    """Grids of all types and packings, each as small as it gets."""
    random = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.vdb"
        for number, (name, kind) in enumerate(VALUE_TYPES.items()):
            shape = (2, 3, 2, 3) if kind.components == 3 else (2, 3, 2)
            values = (random.random(shape) * 9).astype(kind.dtype)
            active = random.random(shape[:3]) < 0.7
            grid = Grid.from_dense(
                "density", values, active, (6, 0, 0), transform=Transform.uniform(0.1),
                half=number % 2 == 0, background=number % 3,
            )  # fmt: skip
            grids = [grid]
            if kind.components == 3:
                grid.name = "velocity"
                density = Grid.from_dense("density", values[..., 0], active, (6, 0, 0), like=grid)
                grids = [density, grid]
            if name == "float":
                tiles = Tiles(
                    np.array([(0, 0, 8), (4096, 0, 0)], np.int32), np.array([8, 4096], np.int32),
                    np.ones(2, np.float32), np.array([True, False]),
                )  # fmt: skip
                grid.tree = grid.tree._replace(tiles=tiles)
            metadata = {"title": "x"} if number % 2 else None
            write_vdb(path, grids, metadata, ("none", "zip", "blosc")[number % 3])
            content = bytearray(path.read_bytes())
            yield taken_apart(bytes(content))
            yield without_offsets(taken_apart(bytes(content)))
            content[_CLAIMS_OFFSETS] = False
            yield taken_apart(bytes(content))
            if name == "int32":
                other = replace(grid, name="other")
                write_vdb(path, [grid, other], compression="none")
                yield with_frustum(taken_apart(path.read_bytes()), other.transform)


def with_frustum(data: bytes, transform: Transform) -> bytes:
    """The same input with the last grid in a frustum, whose linear map is `transform`."""
    *parts, head, values = data.split(_BETWEEN)
    linear = transform.encode()
    frustum = encode_string(b"NonlinearFrustumMap") + struct.pack("<8d", *range(8)) + linear
    return _BETWEEN.join((*parts, shortened(lengthened(head).replace(linear, frustum)), values))


def without_offsets(data: bytes) -> bytes:
    """The same input with offsets of its own: the least that OpenVDB needs for a single grid."""
    parts = data.split(_BETWEEN)
    parts[1::3] = [shortened(b"\x80" + lengthened(names)[1:] + bytes(24)) for names in parts[1::3]]
    return _BETWEEN.join(parts)


if __name__ == "__main__":
    # Smaller arrays than a user may have: a full one would take a second to fill.
    vdb_smoke.MOST_CELLS, vdb_smoke.MOST_CELLS_A_BYTE = 2**14, 1
    blosc.set_nthreads(1)
    fuzz("vdb", suffix=".vdb", build=build, read=read, limit=limit, seeds=seeds(), longest=1024)
