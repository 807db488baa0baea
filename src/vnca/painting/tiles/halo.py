"""How many steps tiles do by themselves: the more, the more cells are computed twice."""

from collections.abc import Sequence

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.bricks import covered
from vnca.core.marks import unpacked
from vnca.painting.tiles.kept import Kept

_LIKELY = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)
FETCH = 5.0
"""What it costs to fetch a cell, make it ready for steps and write it back, in steps of a cell: an
estimate, on which no bit depends."""


def likely_halo(state: Kept, tiles: Sequence[Box], steps: int) -> int:
    """The cheapest number of cells around tiles, and of steps that are done with them.

    Args:
        state: Where cells are.
        tiles: Those of them that hold some.
        steps: How many have to be done.
    """
    counts = unpacked(state.marks).sum(axis=(1, 2, 3))

    def cost(halo: int) -> float:
        rounds = -(-steps // halo)
        worked = sum(_cells(state, counts, tile.grown(-(-steps // rounds))) for tile in tiles)
        return worked * (steps + rounds * FETCH)

    return min([halo for halo in _LIKELY if halo <= steps] or [1], key=cost)


def _cells(state: Kept, counts: AnyArray, box: Box) -> float:
    """About how many cells there are in a box."""
    first, last = covered(state.bricks, box)
    share = np.prod(np.maximum(last - first, 0), axis=1) / 512
    return float((share * counts).sum())
