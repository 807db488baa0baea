"""Opening a VDB file: what grids it holds, and reading one of them.

Reference: OpenVDB `io/Archive.cc` (`readHeader`), `io/File.cc`.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO

from vnca.core.errors import FileFormatError, GridError
from vnca.core.files import existing_file
from vnca.io.vdb.cursor import Cursor
from vnca.io.vdb.grid import Grid
from vnca.io.vdb.header import GridHeader, Source, decoded, read_header
from vnca.io.vdb.layout import MAGIC, NEWEST_VERSION, OLDEST_VERSION
from vnca.io.vdb.metadata import Metadata, read_metadata


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

    def listed(self) -> str:
        """The grids with their types, for messages."""
        grids = [f"{name} ({header.value_type})" for name, header in self.grids.items()]
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
