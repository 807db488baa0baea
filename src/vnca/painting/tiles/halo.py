"""How many steps tiles do by themselves: the more, the more cells are computed twice."""

from collections.abc import Sequence

import numpy as np

from vnca.core import Box
from vnca.core.bricks import CELLS, covered
from vnca.painting.tiles.kept import Kept
from vnca.ranks import Alone, Ranks

_LIKELY = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)
FETCH = 5.0
"""What it costs to fetch a cell, make it ready for steps and write it back, in steps of a cell: an
estimate, on which no bit depends."""


def halos(steps: int) -> list[int]:
    """Those that are chosen from, the widest last."""
    return [halo for halo in _LIKELY if halo <= steps] or [1]


def likely_halo(state: Kept, tiles: Sequence[Box], steps: int, ranks: Ranks | None = None) -> int:
    """The cheapest number of cells around tiles, and of steps that are done with them.

    Args:
        state: Where cells are, those around the tiles among them.
        tiles: Those of this rank that hold some.
        steps: How many have to be done.
        ranks: Who shares the tiles; all choose the same.
    """
    ranks = ranks or Alone()

    def cost(halo: int) -> float:
        rounds = -(-steps // halo)
        worked = sum(_cells(state, tile.grown(-(-steps // rounds))) for tile in tiles)
        return worked * (steps + rounds * FETCH)

    likely = halos(steps)
    costs = np.sum(ranks.every([cost(halo) for halo in likely]), axis=0)
    return likely[int(np.argmin(costs))]


def _cells(state: Kept, box: Box) -> float:
    """About how many cells there are in a box."""
    first, last = covered(state.bricks, box)
    share = np.prod(np.maximum(last - first, 0), axis=1) / CELLS
    return float((share * state.counts).sum())
