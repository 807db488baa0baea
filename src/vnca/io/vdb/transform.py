"""From index space to the world, in the form the file has it.

Reference: OpenVDB `math/Transform.cc`, `math/Maps.h`.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vnca.core.errors import GridError
from vnca.core.typing import AnyArray
from vnca.io.vdb.cursor import Cursor, encode_string

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
