"""What a file says about a grid ahead of its values.

Reference: OpenVDB `io/GridDescriptor.cc`, `io/Archive.cc` (`readGrid`), `io/File.cc`.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from vnca.errors import GridError
from vnca.io.vdb.cursor import Cursor
from vnca.io.vdb.grid import EMPTY_BOX, Grid
from vnca.io.vdb.layout import HALF_SUFFIX, SUFFIX, TREE, VALUE_TYPES, Compression
from vnca.io.vdb.metadata import Metadata, read_metadata
from vnca.io.vdb.transform import Transform, read_transform
from vnca.io.vdb.tree import read_tree
from vnca.typing import Box

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
    """

    path: Path
    stream: BinaryIO
    size: int
    version: int
    library: tuple[int, int]

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
        blocks: Byte where the values of the leaves begin.
        end: One past the grid's last byte.
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
    blocks: int
    end: int
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
        return owner.end - (owner.tree_start or owner.transform_start)

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
        owner = self.parent or self
        cursor = self.source.cursor(owner.tree_start or 0, owner.end, self.name)
        if (value_type := VALUE_TYPES.get(self.value_type)) is None:
            raise cursor.error(
                f"cannot read values of type {self.value_type}, only {', '.join(VALUE_TYPES)}"
            )
        transform = self.transform
        if owner.tree_start is None:
            raise cursor.error(f"its tree lies behind a {owner.map_type} of unknown length")
        if owner.compression > _ALL_FLAGS:
            raise cursor.error(f"unknown compression {int(owner.compression)}")
        tree = read_tree(
            cursor, owner.blocks, value_type, is_half=self.is_half, flags=owner.compression
        )
        name = decoded(self.grid_name)
        return Grid(name, value_type.name, transform, tree, self.metadata, self.is_half)


_ALL_FLAGS = Compression.ZIP | Compression.ACTIVE_MASK | Compression.BLOSC


def read_header(
    cursor: Cursor,
    source: Source,
    taken: Collection[str],
    numbers: dict[str, int],
    parents: Mapping[bytes, GridHeader],
) -> tuple[bytes, GridHeader]:
    """The descriptor at the cursor and what it points to; the cursor moves to the next one.

    Args:
        cursor: Over the whole file.
        source: The file.
        taken: Names of the headers before this one.
        numbers: How often a name was wanted that was taken; kept between calls.
        parents: The headers before this one by the name their descriptor gives.

    Returns:
        The name the descriptor gives, and the header.

    Raises:
        FileFormatError: If the descriptor or what it points to is truncated or corrupt.
    """
    unique_name, type_name, parent_name = cursor.string(), cursor.string(), cursor.string()
    name = _unused_name(unique_name, taken, numbers)
    start, blocks, end = cursor.unpack("3q")
    parent = None
    if parent_name:
        if (parent := parents.get(parent_name)) is None or parent.parent is not None:
            raise cursor.error(f"grid {name!r} shares the tree of a grid that is not there")
        blocks = end  # the descriptor of a grid without a tree leaves it open
    if not cursor.position <= start <= blocks <= end <= cursor.end:
        raise cursor.error(
            f"truncated or corrupt: grid {name!r} claims bytes {start} to {end} of {cursor.end}"
        )
    body = source.cursor(start, blocks, name)
    compression = Compression(body.unpack("I"))
    metadata = read_metadata(body)
    transform_start = body.position
    map_type, transform = read_transform(body)
    tree_start = body.position if transform is not None else None
    cursor.seek(end)
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
        tree_start=tree_start,
        blocks=blocks,
        end=end,
        linear_transform=transform,
        parent=parent,
    )
    if parent and (parent.type_name, parent.is_half) != (header.type_name, header.is_half):
        raise cursor.error(f"corrupt: grid {name!r} shares a tree of another type")
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
