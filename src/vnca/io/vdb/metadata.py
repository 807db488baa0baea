"""Typed key–value pairs of files and grids, kept byte for byte.

Reference: OpenVDB `MetaMap.cc`, `Metadata.h`.
"""

import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vnca.core.errors import OptionError
from vnca.io.vdb.cursor import Cursor, encode_string

_LAYOUTS = {
    "bool": "?", "half": "e", "float": "f", "double": "d", "int32": "i", "int64": "q",
    "vec2i": "2i", "vec2s": "2f", "vec2d": "2d", "vec3i": "3i", "vec3s": "3f", "vec3d": "3d",
    "vec4i": "4i", "vec4s": "4f", "vec4d": "4d", "mat4s": "16f", "mat4d": "16d",
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """One value of the metadata with its type.

    Attributes:
        type_name: OpenVDB's name of the type, which may be one unknown here.
        raw: The value's bytes as in the file.
    """

    type_name: str
    raw: bytes

    @property
    def value(self) -> Any:
        """As str, bool, int, float or tuple (matrices row by row); bytes for unknown types."""
        if self.type_name == "string":
            return self.raw.decode("utf-8", "backslashreplace")
        if (layout := _LAYOUTS.get(self.type_name)) is None:
            return self.raw
        values = struct.unpack(f"<{layout}", self.raw)
        return values[0] if len(values) == 1 else values

    @classmethod
    def of(cls, value: Any, type_name: str | None = None) -> "Entry":
        """An entry for a Python value: string, bool, int32 or int64, double, vec3i, vec3d.

        Args:
            value: A str, bool, int, float or a tuple of two to four numbers.
            type_name: Another of OpenVDB's types to store it as, such as `float`; with one
                unknown here, `value` is bytes.

        Raises:
            OptionError: If the value has no such type.
        """
        name = type_name or _natural_type(value)
        try:
            if name == "string":
                return cls(name, value.encode())
            if (layout := _LAYOUTS.get(name)) is None:
                return cls(name, bytes(value))
            parts = value if isinstance(value, (tuple, list)) else (value,)
            return cls(name, struct.pack(f"<{layout}", *parts))
        except (struct.error, AttributeError, TypeError, ValueError, OverflowError) as error:
            raise OptionError(f"metadata: {value!r} cannot be stored as {name}") from error


def _natural_type(value: Any) -> str:
    if isinstance(value, str):
        return "string"
    if isinstance(value, (bool, np.bool_)):
        return "bool"
    if isinstance(value, (int, np.integer)):
        return "int32" if -(2**31) <= value < 2**31 else "int64"
    if isinstance(value, (float, np.floating)):
        return "double"
    if isinstance(value, (tuple, list)) and 2 <= len(value) <= 4:
        whole = all(isinstance(part, (int, np.integer)) for part in value)
        return f"vec{len(value)}{'i' if whole else 'd'}"
    raise OptionError(f"metadata: {value!r} has no OpenVDB type of its own; name one")


class Metadata(dict[str, Entry]):
    """Entries by name, in the order of the file."""

    @classmethod
    def of(cls, values: "Mapping[str, Any] | None") -> "Metadata":
        """Metadata from Python values; values that are entries already stay as they are."""
        return cls(
            (name, value if isinstance(value, Entry) else Entry.of(value))
            for name, value in (values or {}).items()
        )

    def value(self, name: str, default: Any = None) -> Any:
        """The value stored under `name`, or `default`."""
        return self[name].value if name in self else default

    def without_statistics(self) -> "Metadata":
        """A copy less what OpenVDB computes when it writes a grid.

        The index for delayed loading (`file_delayed_load`) describes one encoding of the tree:
        a stale one makes OpenVDB read rubbish.
        """
        return self.without(STATISTICS)

    def without(self, names: Collection[str]) -> "Metadata":
        """A copy less the entries of these names."""
        return Metadata((name, entry) for name, entry in self.items() if name not in names)

    def encode(self) -> bytes:
        """The bytes of a file, entries in their order here."""
        parts = [struct.pack("<I", len(self))]
        for name, entry in self.items():
            parts += (
                encode_string(name.encode("utf-8", "surrogateescape")),
                encode_string(entry.type_name.encode("utf-8", "surrogateescape")),
                encode_string(entry.raw),
            )
        return b"".join(parts)


STATISTICS = (
    "file_bbox_max",
    "file_bbox_min",
    "file_compression",
    "file_delayed_load",
    "file_mem_bytes",
    "file_voxel_count",
)
# In which programs note the type of a grid's values, besides the tree's own; Houdini the second.
NAMES_OF_TYPES = ("grid_type", "value_type")


def read_metadata(cursor: Cursor) -> Metadata:
    """The metadata at the cursor.

    Raises:
        FileFormatError: If it is truncated, or an entry has not the size of its type.
    """
    metadata = Metadata()
    for _ in range(cursor.unpack("I")):
        # Undecodable bytes travel through and come out again as they were.
        name = cursor.string().decode("utf-8", "surrogateescape")
        type_name = cursor.string().decode("utf-8", "surrogateescape")
        raw = cursor.string()
        layout = _LAYOUTS.get(type_name)
        if layout is not None and len(raw) != struct.calcsize(f"<{layout}"):
            raise cursor.error(f"metadata {name!r} of type {type_name} has {len(raw)} bytes")
        metadata[name] = Entry(type_name, raw)
    return metadata
