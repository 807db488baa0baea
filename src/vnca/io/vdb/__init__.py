"""OpenVDB files: opened for reading, and written with grids encoded here or copied as they are.

The layout of a file is in this folder's README.

Reference: OpenVDB `io/File.cc`, `io/Archive.cc` (`writeHeader`, `write`, `writeGrid`).
"""

import hashlib
import os
import struct
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, NamedTuple

from vnca.core.errors import FileFormatError, GridError, OptionError
from vnca.core.files import existing_file, whole_file
from vnca.io.vdb.encode import encode_grid
from vnca.io.vdb.grid import EMPTY_BOX, Grid
from vnca.io.vdb.header import GridHeader, Source, decoded, read_header
from vnca.io.vdb.layout import (
    HALF_SUFFIX,
    MAGIC,
    NEWEST_VERSION,
    OLDEST_VERSION,
    SUFFIX,
    TREE,
    VALUE_TYPES,
    WRITTEN_LIBRARY,
    WRITTEN_VERSION,
    Compression,
    Cursor,
    ValueType,
    encode_string,
)
from vnca.io.vdb.metadata import Entry, Metadata, Transform, read_metadata
from vnca.io.vdb.part import GridIndex
from vnca.io.vdb.tree import Tiles, Tree

_FLAGS = {
    "none": Compression.ACTIVE_MASK,
    "zip": Compression.ACTIVE_MASK | Compression.ZIP,
    "blosc": Compression.ACTIVE_MASK | Compression.BLOSC,
}
_COPIED_AT_ONCE = 1 << 20
_HALF_GRID_VERSION = 225  # the first in which values themselves may be of type `half`
_INDEX_LIBRARY = (6, 2)  # older libraries copy `file_delayed_load` without keeping it true


class VdbFile:
    """An open file: a header for each grid; values are read when asked for, one grid at a time.

    Close it after use, best as a context manager. One thread at a time may read from it.

    Attributes:
        path: The file.
        metadata: Of the file as a whole.
        grids: Headers by unique name, in the file's order.
        unfound: How many grids the file has behind one whose end nothing tells.
    """

    def __init__(
        self, source: Source, metadata: Metadata, grids: dict[str, GridHeader], unfound: int = 0
    ) -> None:
        self._source = source
        self.path = source.path
        self.metadata = metadata
        self.grids: Mapping[str, GridHeader] = MappingProxyType(grids)
        self.unfound = unfound

    @property
    def names(self) -> tuple[str, ...]:
        """Unique names of the grids, in the file's order."""
        return tuple(self.grids)

    def header(self, name: str) -> GridHeader:
        """The grid of this name; of several `density`, the first.

        Raises:
            GridError: If there is none; the message lists those there are.

        Reference: `io/File.cc`, `findDescriptor`.
        """
        if name in self.grids:
            return self.grids[name]
        for header in self.grids.values():
            if decoded(header.grid_name) == name:
                return header
        raise GridError(f"{self.path}: no grid {name!r}; the file has {self.listed()}")

    def listed(self, names: Iterable[str] | None = None) -> str:
        """The grids with their types, all or some, for messages."""
        names = self.grids if names is None else names
        grids = [f"{name} ({self.grids[name].value_type})" for name in names]
        if self.unfound:
            grids.append(f"{self.unfound} more that cannot be found behind it, for want of offsets")
        return ", ".join(grids) or "no grid at all"

    def read(self, name: str) -> Grid:
        """The grid of this name with its values.

        Raises:
            FileFormatError: If it is truncated, corrupt or of an unsupported kind.
            GridError: If there is none, or the file has been closed.
        """
        return self.header(name).read()

    @property
    def status(self) -> os.stat_result:
        """Size and time of change, as they are now: what was opened, whatever its path leads to."""
        return os.fstat(self._source.stream.fileno())

    def close(self) -> None:
        """Close the file; headers stay usable, values no longer are."""
        self._source.stream.close()

    def __enter__(self) -> "VdbFile":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_vdb(path: Path | str) -> VdbFile:
    """Open a VDB file and read the headers of its grids.

    Raises:
        FileFormatError: If it is missing, not a VDB file, of another version than 222 to 225,
            truncated or corrupt.
    """
    path = existing_file(Path(path))
    try:
        stream = path.open("rb")
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror})") from error
    try:
        cursor = Cursor(stream, 0, os.fstat(stream.fileno()).st_size, str(path))
        source = _read_file_header(cursor, path, stream)
        metadata = read_metadata(cursor)
        return VdbFile(source, metadata, *_read_headers(cursor, source))
    except BaseException:
        stream.close()
        raise


def _read_file_header(cursor: Cursor, path: Path, stream: BinaryIO) -> Source:
    if cursor.remaining < 8 or cursor.unpack("q") != MAGIC:
        raise FileFormatError(f"{path}: not a VDB file")
    version, major, minor, has_offsets = cursor.unpack("III?")
    if not OLDEST_VERSION <= version <= NEWEST_VERSION:
        raise FileFormatError(
            f"{path}: VDB files of version {version} are not supported, only {OLDEST_VERSION} to "
            f"{NEWEST_VERSION}; write it again with a current program"
        )
    cursor.take(36)  # a unique identifier, as text
    return Source(path, stream, cursor.end, version, (major, minor), has_offsets)


def _read_headers(cursor: Cursor, source: Source) -> tuple[dict[str, GridHeader], int]:
    """Headers by unique name, and how many more there are that cannot be found."""
    headers: dict[str, GridHeader] = {}
    numbers: dict[str, int] = {}
    parents: dict[bytes, GridHeader] = {}
    count = cursor.unpack("I")
    for behind in range(count - 1, -1, -1):
        unique_name, header = read_header(
            cursor, source, headers, numbers, parents, is_last=behind == 0
        )
        headers[header.name] = parents[unique_name] = header
        if header.end is None:
            return headers, behind
    return headers, 0


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
        for data in _joined(part.values):
            self.write(data)
        self.patch(offsets_at, struct.pack("<3q", start, blocks, self.position))


def _joined(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The same bytes in fewer pieces: what leaves take is little, and hashing one takes long."""
    waiting, size = [], 0
    for piece in pieces:
        waiting.append(piece)
        size += len(piece)
        if size >= _COPIED_AT_ONCE:
            yield b"".join(waiting)
            waiting, size = [], 0
    yield b"".join(waiting)


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


__all__ = [
    "EMPTY_BOX",
    "VALUE_TYPES",
    "Entry",
    "Grid",
    "GridHeader",
    "GridIndex",
    "Metadata",
    "Tiles",
    "Transform",
    "Tree",
    "ValueType",
    "VdbFile",
    "open_vdb",
    "write_vdb",
]
