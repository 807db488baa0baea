"""What a file says about a grid ahead of its values.

Reference: OpenVDB `io/GridDescriptor.cc`, `io/Archive.cc` (`readGrid`), `io/File.cc`.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from vnca.core import Box
from vnca.core.errors import GridError
from vnca.io.vdb.grid import EMPTY_BOX, Grid
from vnca.io.vdb.layout import (
    HALF_SUFFIX,
    SUFFIX,
    TREE,
    VALUE_TYPES,
    WRITTEN_VERSION,
    Compression,
    Cursor,
    ValueType,
)
from vnca.io.vdb.metadata import Metadata, Transform, read_metadata, read_transform
from vnca.io.vdb.part import GridIndex
from vnca.io.vdb.tree import Leaves, Tree, locate_leaves, read_active, read_tree

_TREE_NAME = "Tree_{}_" + "_".join(map(str, TREE))


@dataclass(frozen=True, eq=False)
class Source:
    """An open file and what its first bytes say.

    Attributes:
        path: For messages.
        stream: The open file.
        size: Bytes in it.
        version: Of the file format.
        library: Major and minor version of the library that wrote it.
        has_offsets: Whether it claims that its grids say where they begin and end.
    """

    path: Path
    stream: BinaryIO
    size: int
    version: int
    library: tuple[int, int]
    has_offsets: bool

    def cursor(self, start: int, end: int, grid: str) -> Cursor:
        """A cursor over a part of the file that belongs to `grid`.

        Raises:
            GridError: If the file has been closed.
        """
        label = f"{self.path}: grid {grid!r}"
        if self.stream.closed:
            raise GridError(f"{label}: the file has been closed; read inside `with open_vdb(…)`")
        return Cursor(self.stream, start, end, label)


@dataclass(frozen=True, eq=False)
class GridHeader:
    """What a file says about a grid ahead of its values.

    Attributes:
        name: Unique in its file: `density`, or `density[1]` where several share a name.
        grid_name: The name alone, as bytes of the file.
        type_name: Of the tree: `Tree_float_5_4_3`.
        is_half: Whether floating-point values are stored as half floats.
        compression: How the grid's values are packed.
        metadata: By name, in the file's order.
        map_type: OpenVDB's name of the transform's kind.
        source: The file.
        transform_start: Byte where the transform begins.
        tree_start: Byte where the tree begins; None behind a transform of unknown length.
        blocks: Byte where the values of the leaves begin; None where the file does not tell.
        end: One past the grid's last byte; None where nothing tells.
        parent: The grid whose tree this one shares.
    """

    name: str
    grid_name: bytes
    type_name: str
    is_half: bool
    compression: Compression
    metadata: Metadata
    map_type: str
    source: Source = field(repr=False)
    transform_start: int
    tree_start: int | None
    blocks: int | None
    end: int | None
    linear_transform: Transform | None = field(repr=False)
    parent: "GridHeader | None" = None

    @property
    def value_type(self) -> str:
        """`float`, `vec3s`, …; the tree's whole type where that is unusual."""
        before, after = _TREE_NAME.split("{}")
        name = self.type_name.removeprefix(before).removesuffix(after)
        return name if name and _TREE_NAME.format(name) == self.type_name else self.type_name

    @property
    def grid_class(self) -> str:
        """`fog volume`, `level set`, `staggered` or `unknown`."""
        return self.metadata.value("class", "unknown")

    @property
    def stored_bytes(self) -> int:
        """Bytes of the file that its tree takes."""
        owner = self.parent or self
        end = self.source.size if owner.end is None else owner.end
        return end - (owner.tree_start or owner.transform_start)

    @property
    def is_readable(self) -> bool:
        """Whether values of this kind can be read here; others are listed and copied."""
        return (self.parent or self)._is_of_known_layout and self.linear_transform is not None

    @property
    def obstacle_to_copying(self) -> str | None:
        """Why it cannot be copied to another file, if so; the words follow its name."""
        owner = self.parent or self
        version = self.source.version
        if version < WRITTEN_VERSION and self.value_type not in VALUE_TYPES:
            return (
                f"is of type {self.value_type}: those are copied only from files of version "
                f"{WRITTEN_VERSION} or newer, this one has {version}"
            )
        if owner.end is None or self.end is None:
            return (
                f"is of type {self.value_type} behind a {self.map_type}: in a file without offsets "
                "nothing tells where it ends; write the file again, or without this grid"
            )
        if owner is not self and owner.tree_start is None:
            return f"shares the tree of a grid with a {owner.map_type}"
        return None

    @property
    def _is_of_known_layout(self) -> bool:
        """Whether it can be told where its tree ends."""
        is_known = self.value_type in VALUE_TYPES and self.compression <= _ALL_FLAGS
        return is_known and self.tree_start is not None

    def measured(self, limit: int) -> "GridHeader":
        """The same with the true `blocks` and `end`, where its tree is of a kind that is known.

        Args:
            limit: Byte beyond which it cannot end.

        Raises:
            FileFormatError: If the tree is truncated or corrupt.
            GridError: If the file has been closed.
        """
        if self.tree_start is None:
            return self
        if self.parent is not None:
            return replace(self, end=self.tree_start)
        if not self._is_of_known_layout:
            return self
        cursor = self.source.cursor(self.tree_start, limit, self.name)
        value_type = VALUE_TYPES[self.value_type]
        leaves = locate_leaves(cursor, value_type, is_half=self.is_half, flags=self.compression)
        return replace(self, blocks=leaves.begin, end=cursor.position)

    @property
    def transform(self) -> Transform:
        """From index space to the world.

        Raises:
            GridError: If it is not linear.
        """
        if self.linear_transform is None:
            raise GridError(
                f"{self.source.path}: grid {self.name!r} has a {self.map_type}; "
                "only linear transforms are supported"
            )
        return self.linear_transform

    @property
    def box(self) -> Box | None:
        """The smallest box around the active cells by the metadata; None if that is silent."""
        metadata = (self.parent or self).metadata
        corners = [metadata.get(f"file_bbox_{end}") for end in ("min", "max")]
        if any(corner is None or corner.type_name != "vec3i" for corner in corners):
            return None
        lower, (x, y, z) = (corner.value for corner in corners if corner is not None)
        box = Box(lower, (x + 1, y + 1, z + 1))
        return EMPTY_BOX if box.is_empty else box

    def read(self) -> Grid:
        """The grid with its values.

        Raises:
            FileFormatError: If it is truncated, corrupt or of an unsupported kind.
            GridError: If the file has been closed or the transform is not linear.
        """
        return self._grid(read_tree)

    def read_active(self) -> Grid:
        """Which cells are active, as a grid of booleans; quick, as no values are read.

        The errors are those of `read`.
        """
        grid = self._grid(read_active, to_the_end=False)
        grid.value_type, grid.is_half = "bool", False
        return grid

    def indexed(self) -> GridIndex:
        """The same with the values of no leaf: those of a part can be read then.

        Raises:
            FileFormatError: As of `read`, but for what is wrong with values.
            GridError: As of `read`.
        """
        leaves: list[Leaves] = []

        def located(cursor: Cursor, value_type: ValueType, **options: Any) -> Tree:
            leaves.append(locate_leaves(cursor, value_type, **options))
            return leaves[0].tree(self._cursor, np.empty(0, np.int64))

        return GridIndex(self._grid(located), leaves[0], self._cursor)

    def _cursor(self, begin: int) -> Cursor:
        owner = self.parent or self
        end = self.source.size if owner.end is None else owner.end
        return self.source.cursor(begin, end, self.name)

    def _grid(self, read: Callable[..., Tree], *, to_the_end: bool = True) -> Grid:
        owner = self.parent or self
        cursor = self._cursor(owner.tree_start or 0)
        if (value_type := VALUE_TYPES.get(self.value_type)) is None:
            raise cursor.error(
                f"cannot read values of type {self.value_type}, only {', '.join(VALUE_TYPES)}"
            )
        transform = self.transform
        if owner.tree_start is None:
            raise cursor.error(f"its tree lies behind a {owner.map_type} of unknown length")
        if owner.compression > _ALL_FLAGS:
            raise cursor.error(f"unknown compression {int(owner.compression)}")
        tree = read(cursor, value_type, is_half=self.is_half, flags=owner.compression)
        if to_the_end and cursor.remaining:
            raise cursor.error(f"corrupt: {cursor.remaining} bytes follow the last leaf")
        name = decoded(self.grid_name)
        return Grid(name, value_type.name, transform, tree, self.metadata, self.is_half)


_ALL_FLAGS = Compression.ZIP | Compression.ACTIVE_MASK | Compression.BLOSC


def read_header(
    cursor: Cursor,
    source: Source,
    taken: Collection[str],
    numbers: dict[str, int],
    parents: Mapping[bytes, GridHeader],
    *,
    is_last: bool,
) -> tuple[bytes, GridHeader]:
    """The descriptor at the cursor and what it points to; the cursor moves to the next one.

    The offsets of a descriptor are hints: streams have none, and writers differ in how many they
    fill in. One that cannot be is not believed; the grid then begins behind its descriptor and
    ends where its tree does. The end of the last grid, of which OpenVDB makes no use, is believed
    where the file ends.

    Args:
        cursor: Over the whole file.
        source: The file.
        taken: Names of the headers before this one.
        numbers: How often a name was wanted that was taken; kept between calls.
        parents: The headers before this one by the name their descriptor gives.
        is_last: Whether no descriptor follows.

    Returns:
        The name the descriptor gives, and the header. Where its end is None, the cursor stays
        inside the grid.

    Raises:
        FileFormatError: If the descriptor or what it points to is truncated or corrupt.
    """
    unique_name, type_name, parent_name = cursor.string(), cursor.string(), cursor.string()
    name = _unused_name(unique_name, taken, numbers)
    start, blocks, end = cursor.unpack("3q")
    parent = None
    if parent_name and ((parent := parents.get(parent_name)) is None or parent.parent is not None):
        raise cursor.error(f"grid {name!r} shares the tree of a grid that is not there")
    has_start = source.has_offsets and cursor.position <= start <= cursor.end
    has_end = has_start and start < end <= cursor.end
    body = source.cursor(
        start if has_start else cursor.position, end if has_end else cursor.end, name
    )
    compression = Compression(body.unpack("I"))
    metadata = read_metadata(body)
    transform_start = body.position
    map_type, transform, is_known_map = read_transform(body)
    half_suffix = HALF_SUFFIX.encode()
    header = GridHeader(
        name=name,
        grid_name=unique_name.partition(SUFFIX.encode())[0],
        type_name=decoded(type_name.removesuffix(half_suffix)),
        is_half=type_name.endswith(half_suffix),
        compression=compression,
        metadata=metadata,
        map_type=map_type,
        source=source,
        transform_start=transform_start,
        tree_start=body.position if is_known_map else None,
        blocks=blocks if has_end and body.position < blocks <= end else None,
        end=end if has_end else None,
        linear_transform=transform,
        parent=parent,
    )
    if parent and (parent.type_name, parent.is_half) != (header.type_name, header.is_half):
        raise cursor.error(f"corrupt: grid {name!r} shares a tree of another type")
    if header.end is None or (is_last and header.end < cursor.end):
        header = header.measured(cursor.end)
    if header.end is None and source.has_offsets:
        raise cursor.error(
            f"truncated or corrupt: grid {name!r} claims bytes {start} to {end} of {cursor.end}"
        )
    if header.end is None and is_last:
        header = replace(header, end=cursor.end)
    if header.end is not None:
        cursor.seek(header.end)
    return unique_name, header


def decoded(name: bytes) -> str:
    """A name of the file as text that can always be printed."""
    return name.decode("utf-8", "backslashreplace")


def _unused_name(unique_name: bytes, taken: Collection[str], numbers: dict[str, int]) -> str:
    """Reference: `io/GridDescriptor.cc`, `nameAsString`."""
    base, separator, number = decoded(unique_name).partition(SUFFIX)
    name = first = f"{base}[{number}]" if separator else base
    while name in taken:
        numbers[first] = numbers.get(first, 0) + 1
        name = f"{first}[{numbers[first]}]"
    return name
