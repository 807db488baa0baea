"""Sizes, codes and names of the OpenVDB format, and a cursor that reads it, never past its end.

Reference: OpenVDB `version.h`, `tree/Tree.h`, `io/Compression.h`, `Types.h`.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cache
from typing import Any, BinaryIO

import numpy as np

from vnca.core import AnyArray, IntArray
from vnca.core.errors import FileFormatError

MAGIC = 0x56444220
OLDEST_VERSION, NEWEST_VERSION = 222, 225
WRITTEN_VERSION, WRITTEN_LIBRARY = 224, (10, 0)

# A 5-4-3 tree: cells along a node's edge, and along the edge of one of its slots.
TREE = (5, 4, 3)
UPPER_EDGE, LOWER_EDGE, LEAF_EDGE = 4096, 128, 8
UPPER_SLOTS, LOWER_SLOTS, LEAF_CELLS = 32**3, 16**3, 8**3

SUFFIX = "\x1e"  # between a grid's name and its number where a name occurs more than once
HALF_SUFFIX = "_HalfFloat"


class Compression(IntFlag):
    """How a grid's values are packed. Reference: `io/Compression.h`."""

    ZIP = 1
    ACTIVE_MASK = 2
    BLOSC = 4

    def describe(self) -> str:
        """The words of the metadata `file_compression`."""
        words = {Compression.ZIP: "zip", Compression.BLOSC: "blosc"}
        words[Compression.ACTIVE_MASK] = "active values"
        return " + ".join(word for flag, word in words.items() if flag in self) or "none"


class NodeCode(IntEnum):
    """What a node stores of its inactive values. Reference: `io/Compression.h`."""

    BACKGROUND = 0
    MINUS_BACKGROUND = 1
    ONE_VALUE = 2
    MASK_OF_BACKGROUNDS = 3
    MASK_AND_ONE_VALUE = 4
    MASK_AND_TWO_VALUES = 5
    ALL_VALUES = 6


@dataclass(frozen=True)
class ValueType:
    """The type of a grid's values.

    Attributes:
        name: OpenVDB's name, as in `Tree_vec3s_5_4_3`.
        dtype: Of one component.
        components: 1, or 3 for vectors.
    """

    name: str
    dtype: np.dtype
    components: int

    @property
    def size(self) -> int:
        """Bytes a value takes in memory and, unless stored as half floats, in files."""
        return self.dtype.itemsize * self.components

    def stored_dtype(self, is_half: bool) -> np.dtype:
        """Type of a component inside nodes. Integers ignore the wish for half floats."""
        if is_half and self.dtype.kind == "f":
            return np.dtype("<f2")
        # Bytes other than 0 and 1 make no valid numpy booleans; integers convert safely.
        return np.dtype("u1") if self.dtype == np.bool_ else self.dtype

    def shaped(self, values: AnyArray) -> AnyArray:
        """`[..., component]` as users see it: without the last axis for scalars."""
        return values[..., 0] if self.components == 1 else values

    def unshaped(self, values: AnyArray) -> AnyArray:
        """The inverse of `shaped`."""
        return values[..., None] if self.components == 1 else values


VALUE_TYPES = {
    name: ValueType(name, np.dtype(dtype), components)
    for name, dtype, components in (
        ("bool", "?", 1),
        ("half", "<f2", 1),
        ("float", "<f4", 1),
        ("double", "<f8", 1),
        ("int32", "<i4", 1),
        ("int64", "<i8", 1),
        ("vec3i", "<i4", 3),
        ("vec3s", "<f4", 3),
        ("vec3d", "<f8", 3),
    )
}


def bits_of(mask: bytes) -> AnyArray:
    """A node mask as booleans. Reference: `util/NodeMasks.h` (bit n is bit n % 8 of byte n / 8)."""
    return np.unpackbits(np.frombuffer(mask, np.uint8), bitorder="little").view(np.bool_)


def slot_origins(slots: AnyArray, per_edge: int, slot_edge: int) -> IntArray:
    """Lowest cell of each slot relative to its node, `[n, 3]`.

    Reference: `tree/InternalNode.h`, `offsetToLocalCoord` (x runs slowest).
    """
    corners = np.stack(np.unravel_index(slots, (per_edge,) * 3), axis=-1)
    return (corners * slot_edge).astype(np.int32)


def slots_of(origins: AnyArray, per_edge: int, slot_edge: int) -> AnyArray:
    """Number of the slot that holds each of `origins` `[n, 3]` in its node.

    Reference: `tree/InternalNode.h`, `coordToOffset`.
    """
    x, y, z = (origins // slot_edge % per_edge).T
    return (x * per_edge + y) * per_edge + z


class Cursor:
    """A position in a stream between two bounds.

    Every length found in a file goes through `take` or `expect`, which compare it with what is
    left: a corrupt length is an error, not an allocation.

    Args:
        stream: Seekable; one cursor at a time uses it.
        start: First byte.
        end: One past the last byte.
        label: What is being read, for messages.
    """

    def __init__(self, stream: BinaryIO, start: int, end: int, label: str) -> None:
        self._stream = stream
        self.position = start
        self.end = end
        self.label = label
        stream.seek(start)

    @property
    def remaining(self) -> int:
        """Bytes left before the end."""
        return self.end - self.position

    def error(self, what: str) -> FileFormatError:
        """An error to raise, naming the thing being read and where the cursor stands."""
        return FileFormatError(f"{self.label}: {what} (at byte {self.position})")

    def expect(self, count: int) -> None:
        """Make sure that `count` bytes are left.

        Raises:
            FileFormatError: If not.
        """
        if not 0 <= count <= self.end - self.position:
            raise self.error(
                f"truncated or corrupt: needs {count} bytes more, {self.remaining} are left"
            )

    def take(self, count: int) -> bytes:
        """The next `count` bytes.

        Raises:
            FileFormatError: If fewer are left, or the file cannot be read.
        """
        self.expect(count)
        try:
            data = self._stream.read(count)
        except OSError as error:
            raise self.error(f"cannot be read ({error.strerror})") from error
        if len(data) != count:
            raise self.error("the file became shorter while it was read")
        self.position += count
        return data

    def seek(self, position: int) -> None:
        """Go on at `position`, which is not behind the cursor.

        Raises:
            FileFormatError: If it is, or lies beyond the end.
        """
        self.expect(position - self.position)
        self.position = position
        self._stream.seek(position)

    def unpack(self, layout: str) -> Any:
        """The next little-endian value of `layout` (as `struct`), or a tuple of several."""
        form = _form(layout)
        values = form.unpack(self.take(form.size))
        return values[0] if len(values) == 1 else values

    def string(self) -> bytes:
        """The next string. Reference: `util/Name.h`, `readString`."""
        return self.take(self.unpack("I"))


@cache
def _form(layout: str) -> struct.Struct:
    return struct.Struct(f"<{layout}")


def encode_string(text: bytes) -> bytes:
    """`text` as the format stores it. Reference: `util/Name.h`, `writeString`."""
    return struct.pack("<I", len(text)) + text
