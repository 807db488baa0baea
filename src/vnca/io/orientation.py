"""Between the axes of a file and ours, where up is +z.

For a file with y up, ours is (x, y, z) = its (z, x, y): a rotation, without flips, of its index
axes and of its world alike. So `index_to_world` leads to a world where up is +z, too.
"""

from typing import Literal, TypeAlias

import numpy as np

from vnca.typing import AnyArray, Box, Index

UpAxis: TypeAlias = Literal["z", "y"]

# For each of our axes, the file's; and the reverse.
_TO_INTERNAL: dict[UpAxis, Index] = {"z": (0, 1, 2), "y": (2, 0, 1)}
_TO_FILE: dict[UpAxis, Index] = {"z": (0, 1, 2), "y": (1, 2, 0)}


def to_internal(array: AnyArray, up: UpAxis, *, vectors: bool = False) -> AnyArray:
    """A file's `[x, y, z, ...]` with our axes; with `vectors`, the last axis turns as well."""
    return _turned(array, _TO_INTERNAL[up], vectors)


def to_file(array: AnyArray, up: UpAxis, *, vectors: bool = False) -> AnyArray:
    """The inverse of `to_internal`."""
    return _turned(array, _TO_FILE[up], vectors)


def box_to_internal(box: Box, up: UpAxis) -> Box:
    """A box of the file's cells with our axes."""
    return Box(*(index_to_internal(corner, up) for corner in box))


def box_to_file(box: Box, up: UpAxis) -> Box:
    """The inverse of `box_to_internal`."""
    return Box(*(_picked(corner, _TO_FILE[up]) for corner in box))


def index_to_internal(index: Index, up: UpAxis) -> Index:
    """Coordinates of a cell of the file with our axes."""
    return _picked(index, _TO_INTERNAL[up])


def matrix_to_internal(index_to_world: AnyArray, up: UpAxis) -> AnyArray:
    """A file's 4×4 `index_to_world` for our indices, to a world where up is +z."""
    order = [*_TO_INTERNAL[up], 3]
    return index_to_world[np.ix_(order, order)]


def _turned(array: AnyArray, order: Index, vectors: bool) -> AnyArray:
    if order == (0, 1, 2):
        return np.ascontiguousarray(array)
    array = array.transpose(*order, *range(3, array.ndim))
    return np.ascontiguousarray(array[..., order] if vectors else array)


def _picked(index: Index, order: Index) -> Index:
    x, y, z = (index[axis] for axis in order)
    return x, y, z
