"""What is told of files and grids beside their values: typed entries, and where a grid lies.

Key–value pairs are kept byte for byte, the map from index space to the world in the form that the
file has it.

Reference: OpenVDB `MetaMap.cc`, `Metadata.h`, `math/Transform.cc`, `math/Maps.h`.
"""

import struct
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import GridError, OptionError
from vnca.io.vdb.layout import Cursor, encode_string

_LAYOUTS = {
    "bool": "?", "half": "e", "float": "f", "double": "d", "int32": "i", "int64": "q",
    "vec2i": "2i", "vec2s": "2f", "vec2d": "2d", "vec3i": "3i", "vec3s": "3f", "vec3d": "3d",
    "vec4i": "4i", "vec4s": "4f", "vec4d": "4d", "mat4s": "16f", "mat4d": "16d",
}  # fmt: skip
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
# Doubles each linear map stores.
_DOUBLES = {
    "UniformScaleMap": 15,
    "ScaleMap": 15,
    "UniformScaleTranslateMap": 18,
    "ScaleTranslateMap": 18,
    "TranslationMap": 3,
    "AffineMap": 16,
    "UnitaryMap": 16,
}
LINEAR_MAPS = frozenset(_DOUBLES)
# The one map that is not linear: a box, taper and depth, and behind them a linear map.
_FRUSTUM, _FRUSTUM_DOUBLES = "NonlinearFrustumMap", 8
# Numbers from here to its inverse can be inverted and squared in double precision.
_LARGEST = 1e30


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


@dataclass(frozen=True)
class Transform:
    """A linear map from index space to the world.

    Attributes:
        map_type: OpenVDB's name of the map.
        numbers: What the map stores; some of it is redundant and kept as found.
    """

    map_type: str
    numbers: tuple[float, ...]

    @property
    def index_to_world(self) -> AnyArray:
        """4×4 float64, `world = index_to_world @ (i, j, k, 1)` for cell centres."""
        matrix = np.eye(4)
        numbers = np.array(self.numbers)
        if len(numbers) == 16:
            return numbers.reshape(4, 4).T.copy()  # stored for row vectors
        if "Translat" in self.map_type:
            matrix[:3, 3], numbers = numbers[:3], numbers[3:]
        if "Scale" in self.map_type:
            matrix[:3, :3] = np.diag(numbers[:3])
        return matrix

    @property
    def voxel_size(self) -> tuple[float, float, float]:
        """World length of a cell along x, y and z."""
        x, y, z = np.linalg.norm(self.index_to_world[:3, :3], axis=0)
        return float(x), float(y), float(z)

    @classmethod
    def uniform(
        cls, voxel_size: float, translation: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> "Transform":
        """Cubic cells of `voxel_size`, cell (0, 0, 0) centred on `translation` (world)."""
        matrix = np.diag([voxel_size, voxel_size, voxel_size, 1.0])
        matrix[:3, 3] = translation
        return cls.from_matrix(matrix)

    @classmethod
    def from_matrix(cls, index_to_world: AnyArray) -> "Transform":
        """The simplest of OpenVDB's maps that says the same as a 4×4 column-convention matrix.

        Raises:
            GridError: If the matrix is not affine and invertible, or of absurd size.
        """
        matrix = np.asarray(index_to_world, np.float64)
        if matrix.shape != (4, 4) or not _is_usable(matrix):
            raise GridError(
                f"transform: expected an affine, invertible 4×4 matrix, got {matrix.tolist()}"
            )
        scale, translation = np.diag(matrix)[:3], matrix[:3, 3]
        if not np.array_equal(matrix[:3, :3], np.diag(scale)):
            return cls("AffineMap", tuple(matrix.T.ravel().tolist()))
        name = "UniformScale" if scale[0] == scale[1] == scale[2] else "Scale"
        inverse = 1.0 / scale
        numbers = [scale, abs(scale), inverse, inverse * inverse, inverse / 2]
        if translation.any():
            name, numbers = name + "Translate", [translation, *numbers]
        return cls(f"{name}Map", tuple(np.concatenate(numbers).tolist()))

    def encode(self) -> bytes:
        """The bytes of a file."""
        return encode_string(self.map_type.encode()) + struct.pack(
            f"<{len(self.numbers)}d", *self.numbers
        )


def _is_usable(matrix: AnyArray) -> bool:
    # Not-a-numbers are not smaller either.
    if not (abs(matrix) <= _LARGEST).all() or not np.array_equal(matrix[3], (0, 0, 0, 1)):
        return False
    _, log_volume = np.linalg.slogdet(matrix[:3, :3])
    return bool(log_volume >= -3 * np.log(_LARGEST))


def read_transform(cursor: Cursor) -> tuple[str, Transform | None, bool]:
    """The map at the cursor: its name, the map itself if it is linear, and whether it is known.

    The cursor moves past a known map; it stays inside others, whose length nobody can tell.

    Raises:
        FileFormatError: If a linear map is truncated, not invertible or of absurd size.

    Reference: `math/Maps.h`, `read`.
    """
    map_type = _map_type(cursor)
    if map_type == _FRUSTUM:
        cursor.take(8 * _FRUSTUM_DOUBLES)
        inner = _map_type(cursor)
        if inner in LINEAR_MAPS:
            cursor.take(8 * _DOUBLES[inner])
        return map_type, None, inner in LINEAR_MAPS
    if map_type not in LINEAR_MAPS:
        return map_type, None, False
    transform = Transform(map_type, cursor.unpack(f"{_DOUBLES[map_type]}d"))
    if not _is_usable(transform.index_to_world):
        raise cursor.error(f"corrupt: its {map_type} is not invertible, or of absurd size")
    return map_type, transform, True


def _map_type(cursor: Cursor) -> str:
    return cursor.string().decode("utf-8", "backslashreplace")
