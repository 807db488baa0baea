"""Writing VDB files: grids encoded here, and grids of open files copied as they are.

Reference: OpenVDB `io/Archive.cc` (`writeHeader`, `write`, `writeGrid`).
"""

import hashlib
import struct
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from vnca.errors import GridError, OptionError
from vnca.files import whole_file
from vnca.io.vdb.cursor import encode_string
from vnca.io.vdb.encode import encode_grid
from vnca.io.vdb.grid import Grid
from vnca.io.vdb.header import GridHeader
from vnca.io.vdb.layout import (
    HALF_SUFFIX,
    MAGIC,
    SUFFIX,
    TREE,
    WRITTEN_LIBRARY,
    WRITTEN_VERSION,
    Compression,
)
from vnca.io.vdb.metadata import Metadata

_FLAGS = {
    "none": Compression.ACTIVE_MASK,
    "zip": Compression.ACTIVE_MASK | Compression.ZIP,
    "blosc": Compression.ACTIVE_MASK | Compression.BLOSC,
}
_COPIED_AT_ONCE = 1 << 20
_HALF_GRID_VERSION = 225  # the first in which values themselves may be of type `half`
_INDEX_LIBRARY = (6, 2)  # older libraries copy `file_delayed_load` without keeping it true


class _Part(NamedTuple):
    """A grid on its way into a file: what stands before its leaves' values, and those."""

    name: bytes
    type_name: str
    before: Iterable[bytes]
    values: Iterable[bytes]


def write_vdb(
    path: Path | str,
    grids: Sequence[Grid | GridHeader],
    metadata: Mapping[str, Any] | None = None,
    compression: str = "blosc",
) -> None:
    """Write a VDB file, the same bytes for the same input.

    A `Grid` is encoded, its inactive values omitted where they are background. A `GridHeader` of
    an open file is copied: its metadata, transform and packed values arrive byte for byte, also
    of kinds that cannot be read here; it passes through in pieces, never whole in memory.

    The version is 224, or 225 if there is a grid of type `half`, which older libraries lack.

    Args:
        path: The file to write; it appears whole or not at all.
        grids: In the order of the file; several may have one name.
        metadata: Of the file, as entries or Python values.
        compression: `blosc`, `zip` or `none`, for the grids that are encoded.

    Raises:
        OptionError: If the compression or a piece of metadata has no form in the format.
        GridError: If a grid cannot be encoded or copied.
        OutputError: If the path cannot be written.
        FileFormatError: If a file that is copied from turns out to be truncated.
    """
    if compression not in _FLAGS:
        raise OptionError(f"compression: expected one of {', '.join(_FLAGS)}, got {compression!r}")
    file_metadata = Metadata.of(metadata)
    with whole_file(Path(path)) as temporary, temporary.open("wb") as file:
        output = _HashedFile(file)
        is_newer = any(grid.value_type == "half" for grid in grids)
        version = _HALF_GRID_VERSION if is_newer else WRITTEN_VERSION
        output.write(struct.pack("<qIII?", MAGIC, version, *WRITTEN_LIBRARY, True))
        identifier_at = output.position
        output.write(b"\0" * 36)
        output.write(file_metadata.encode() + struct.pack("<I", len(grids)))
        for grid, name in zip(grids, _unique_names(grids), strict=True):
            output.write_grid(_part_of(grid, name, _FLAGS[compression]))
        output.patch(identifier_at, output.identifier().encode())


class _HashedFile:
    """A file that knows the hash of what was written."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._hash = hashlib.blake2b(digest_size=16)
        self.position = 0

    def write(self, data: bytes) -> None:
        self._hash.update(data)
        self._file.write(data)
        self.position += len(data)

    def patch(self, position: int, data: bytes) -> None:
        self._file.seek(position)
        self._file.write(data)
        self._file.seek(self.position)

    def identifier(self) -> str:
        """A unique identifier that depends on nothing but the content."""
        return str(uuid.UUID(bytes=self._hash.digest(), version=5))

    def write_grid(self, part: _Part) -> None:
        """Write a grid behind its descriptor. Reference: `io/GridDescriptor.cc`, `writeHeader`."""
        for text in (part.name, part.type_name.encode(), b""):
            self.write(encode_string(text))
        offsets_at = self.position
        self.write(bytes(24))
        start = self.position
        for data in part.before:
            self.write(data)
        blocks = self.position
        for data in part.values:
            self.write(data)
        self.patch(offsets_at, struct.pack("<3q", start, blocks, self.position))


def _unique_names(grids: Sequence[Grid | GridHeader]) -> Iterator[bytes]:
    """Names with a number where one occurs more than once, or is empty."""
    names = [grid.name.encode() if isinstance(grid, Grid) else grid.grid_name for grid in grids]
    counts, separator = Counter(names), SUFFIX.encode()
    for name in names:
        if separator in name:
            raise GridError(f"grid {name!r}: a name cannot hold the character \\x1e")
    used: Counter[bytes] = Counter()
    for name in names:
        number = used[name]
        used[name] += 1
        is_numbered = not name or counts[name] > 1
        yield name + separator + str(number).encode() if is_numbered else name


def _part_of(grid: Grid | GridHeader, name: bytes, flags: Compression) -> _Part:
    if isinstance(grid, GridHeader):
        return _copied(grid, name)
    encoded = encode_grid(grid, flags)
    type_name = "_".join(("Tree", grid.value_type, *map(str, TREE)))
    return _Part(
        name,
        type_name + HALF_SUFFIX * grid.is_half,
        (encoded.head, encoded.topology),
        encoded.values,
    )


def _copied(header: GridHeader, name: bytes) -> _Part:
    """The grid of another file. A grid that shares a tree gets a copy of its own."""
    owner = header.parent or header
    label = f"{header.source.path}: grid {header.name!r}"
    if (obstacle := header.obstacle_to_copying) is not None:
        raise GridError(f"{label} {obstacle}")
    assert owner.end is not None
    assert header.end is not None
    blocks = owner.blocks or owner.measured(owner.end).blocks or owner.end
    metadata = header.metadata
    if header.source.library < _INDEX_LIBRARY:
        metadata = Metadata(metadata)
        metadata.pop("file_delayed_load", None)
    head = struct.pack("<I", owner.compression) + metadata.encode()
    transform_and_tree = [(header.transform_start, blocks)]
    if header is not owner:
        transform_and_tree = [
            (header.transform_start, header.end),
            (owner.tree_start or 0, blocks),
        ]

    def before() -> Iterator[bytes]:
        yield head
        for start, end in transform_and_tree:
            yield from _bytes_of(header, start, end)

    return _Part(
        name,
        header.type_name + HALF_SUFFIX * header.is_half,
        before(),
        _bytes_of(header, blocks, owner.end),
    )


def _bytes_of(header: GridHeader, start: int, end: int) -> Iterator[bytes]:
    cursor = header.source.cursor(start, end, header.name)
    while cursor.remaining:
        yield cursor.take(min(cursor.remaining, _COPIED_AT_ONCE))
