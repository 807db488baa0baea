"""Where bricks lie, and where cells lie in them.

A brick is a cube of 8³ cells whose lowest one has index coordinates that are multiples of 8; its
own coordinates are those divided by 8. The leaves of OpenVDB are the same cubes.
"""

from functools import cached_property
from itertools import product

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, IntArray

EDGE, CELLS = 8, 512
"""Cells along an edge of a brick, and in it."""


class Places:
    """Finds bricks by their coordinates; cost follows how many there are, not how far apart."""

    def __init__(self, bricks: IntArray) -> None:
        """For bricks `[m, 3]` in the order of `sorted_bricks`, each once."""
        self.bricks = bricks

    @cached_property
    def _columns(self) -> tuple[AnyArray, AnyArray]:
        """Keys of the columns along z that hold bricks; and of the bricks, by column and z."""
        keys = _column_keys(self.bricks)
        columns, of_bricks = np.unique(keys, return_inverse=True)
        return columns, (of_bricks.reshape(-1) << 32) + self.bricks[:, 2]

    def find(self, wanted: AnyArray) -> AnyArray:
        """Which brick lies at each of some coordinates `[k, 3]`: `[k]`, m where there is none."""
        columns, keys = self._columns
        column, is_column = _found(columns, _column_keys(wanted))
        brick, is_brick = _found(keys, (column << 32) + wanted[:, 2])
        return np.where(is_column & is_brick, brick, len(self.bricks))


def sorted_bricks(bricks: AnyArray) -> IntArray:
    """Coordinates `[m, 3]` by x, then y, then z, each once."""
    bricks = bricks[np.lexsort(bricks.T[::-1])]
    is_new = np.ones(len(bricks), bool)
    is_new[1:] = (bricks[1:] != bricks[:-1]).any(axis=1)
    return bricks[is_new].astype(np.int32)


def bricks_beside(bricks: IntArray, rings: int = 1) -> IntArray:
    """The bricks and those at most `rings` from them along each axis, sorted."""
    for axis in range(3):
        step = np.eye(3, dtype=np.int32)[axis]
        shifts = [bricks + shift * step for shift in range(-rings, rings + 1)]
        bricks = sorted_bricks(np.concatenate(shifts))
    return bricks


def bricks_reached(
    bricks: IntArray, matrix: AnyArray, box: Box, *, margin: float, most: int
) -> IntArray | None:
    """Bricks of another grid, in a box there, that some bricks and the cells around reach into.

    Args:
        bricks: `[m, 3]` of the one grid.
        matrix: 4×4, from its index coordinates to the other's.
        box: Cells of the other.
        margin: How many cells around each brick count, and half a cell more in the other.
        most: How many bricks there may be.

    Returns:
        Their coordinates `[n, 3]`, sorted; None if there are more.
    """
    ends = np.array(list(product((-margin - 0.5, EDGE - 0.5 + margin), repeat=3)))
    corners = (bricks[:, None] * EDGE + ends) @ matrix[:3, :3].T + matrix[:3, 3]
    first = np.maximum(np.floor(corners.min(axis=1) - 0.5), box.lower) // EDGE
    last = np.minimum(np.ceil(corners.max(axis=1) + 0.5), np.array(box.upper) - 1) // EDGE
    counts = np.maximum(last - first + 1, 0)
    # Bricks that lie beside each other reach into some of the same.
    if counts.prod(axis=1).sum() > 8 * most:
        return None
    steps = product(*map(range, counts.max(axis=0, initial=0).astype(int)))
    found = [first[(counts > step).all(axis=1)] + step for step in steps]
    reached = sorted_bricks(np.concatenate([np.empty((0, 3)), *found]))
    return reached if len(reached) <= most else None


def runs_of_bricks(cells: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Cells `[n, 3]` as runs that share a brick: its coordinates `[r, 3]`, and lengths `[r]`."""
    bricks = cells >> 3
    begins = np.ones(len(cells), bool)
    begins[1:] = bricks[1:, 0] != bricks[:-1, 0]
    for axis in (1, 2):
        begins[1:] |= bricks[1:, axis] != bricks[:-1, axis]
    starts = np.flatnonzero(begins)
    return bricks[starts], np.diff(starts, append=len(cells))


def places_in_bricks(cells: AnyArray) -> AnyArray:
    """Number `[n]`, 0 to 511, of each of the cells `[n, 3]` in its brick, z fastest."""
    x, y, z = (cells & 7).T
    return (x << 6) | (y << 3) | z


def cells_at(bricks: IntArray, where: BoolArray) -> IntArray:
    """Index coordinates `[n, 3]` of the cells where `where` `[m, 8, 8, 8]` holds, in its order."""
    at = np.flatnonzero(where)
    brick, place = at >> 9, at & (CELLS - 1)
    cells = np.empty((len(at), 3), np.int32)
    for axis, shift in enumerate((6, 3, 0)):
        cells[:, axis] = (bricks[:, axis] << 3)[brick] + ((place >> shift) & 7)
    return cells


def covered(bricks: IntArray, box: Box) -> tuple[AnyArray, AnyArray]:
    """Which part of bricks `[m, 3]` lies in a box.

    Returns:
        Places along each axis from which, `[m, 3]`, and up to which it reaches, 0 to 8. Where one
        reaches no farther than it begins, the brick lies outside.
    """
    lowest = bricks.astype(np.int64) * EDGE
    first, last = (np.clip(np.asarray(corner) - lowest, 0, EDGE) for corner in box)
    return first, last


def meeting(bricks: IntArray, box: Box) -> BoolArray:
    """Which of the bricks `[m, 3]` have cells in a box: `[m]`."""
    first, last = covered(bricks, box)
    return np.asarray((first < last).all(axis=1))


def _column_keys(bricks: AnyArray) -> AnyArray:
    return (bricks[:, 0].astype(np.int64) << 32) + bricks[:, 1]


def _found(keys: AnyArray, wanted: AnyArray) -> tuple[AnyArray, BoolArray]:
    """Where each wanted key stands among sorted ones, and whether it is there at all."""
    at = np.searchsorted(keys, wanted)
    if len(keys) == 0:
        return at, np.zeros(len(at), bool)
    at = np.minimum(at, len(keys) - 1)
    return at, keys[at] == wanted
