"""What tiles of a frame with ghost zones tell each other, from where its cells are."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.bricks import EDGE
from vnca.core.field import Field
from vnca.engine.automaton import OFFSETS
from vnca.painting.tiles.deal import dealt


@dataclass(frozen=True, eq=False)
class Shares:
    """Tiles of a frame, and whose they are.

    Attributes:
        owners: `[t]` the rank of each tile.
        cells: `[t]` cells in it.
        around: `[t]` cells in its ghost zone,
        foreign: `[t]` and those of them that other ranks keep.
        pairs: `[p, 2]` ranks: who is told, and by whom.
    """

    owners: AnyArray
    cells: AnyArray
    around: AnyArray
    foreign: AnyArray
    pairs: AnyArray

    def of_ranks(self, values: AnyArray) -> AnyArray:
        """Sums `[ranks]` of values `[t]` of tiles."""
        return np.bincount(self.owners, values, int(self.owners.max(initial=0)) + 1)


class Exchange(NamedTuple):
    """What tiles of a frame with ghost zones tell each other.

    Attributes:
        tiles: Tiles with cells.
        ranks: Among how many they are dealt; unless given, each is a rank of its own.
        messages: From a rank to another, each time ghost zones are filled.
        ghosts: Cells that are sent each time.
        around: Cells in the ghost zones of all tiles, which are computed again.
        largest: Cells of the largest tile, with its ghost zone.
        busiest: Cells of the rank that has most.
        cells: Cells of all tiles, without ghost zones.
    """

    tiles: int
    ranks: int
    messages: int
    ghosts: int
    around: int
    largest: int
    busiest: int
    cells: int


def exchanged(alive: Field, tile: int, halo: int, ranks: int | None = None) -> Exchange:
    """What tiles of so many cells along an edge exchange; see `shared_out`."""
    shares = shared_out(alive, tile, halo, ranks)
    return Exchange(
        len(shares.cells),
        len(shares.cells) if ranks is None else ranks,
        len(shares.pairs),
        round(shares.foreign.sum()),
        round(shares.around.sum()),
        round((shares.cells + shares.around).max()),
        round(shares.of_ranks(shares.cells).max()),
        round(shares.cells.sum()),
    )


def shared_out(alive: Field, tile: int, halo: float, ranks: int | None = None) -> Shares:
    """How tiles are dealt, and what is around them; cells of a brick are taken as spread in it.

    Args:
        alive: Cells of the automaton.
        tile: Cells along the edge of a tile, a multiple of 8.
        halo: Cells of a ghost zone, at most those of a tile: as many steps are done between two
            exchanges.
        ranks: Among how many ranks they are dealt; each is a rank of its own unless given.
    """
    counts = alive.values.reshape(len(alive.values), -1).sum(axis=1)
    lowest = alive.bricks.astype(np.int64) * EDGE
    tiles, of = np.unique(lowest // tile, axis=0, return_inverse=True)
    of = of.reshape(-1)
    cells = np.bincount(of, counts, len(tiles))
    boxes = [Box(at, (at[0] + 1, at[1] + 1, at[2] + 1)) for at in map(tuple, tiles.tolist())]
    owners = np.arange(len(tiles))
    if ranks is not None:
        owners = np.array(dealt(boxes, cells.tolist(), ranks), int)
    known = {box.lower: number for number, box in enumerate(boxes)}
    around, foreign = np.zeros(len(tiles)), np.zeros(len(tiles))
    pairs: set[tuple[int, int]] = set()
    for step in OFFSETS[OFFSETS.any(axis=1)]:
        reached = tiles[of] + step
        share = _shared(lowest, reached * tile, tile, halo)
        for brick in np.flatnonzero((share > 0) & (counts > 0)):
            to = known.get(tuple(reached[brick].tolist()))
            if to is None:
                continue
            around[to] += counts[brick] * share[brick]
            if owners[to] != owners[of[brick]]:
                foreign[to] += counts[brick] * share[brick]
                pairs.add((int(owners[to]), int(owners[of[brick]])))
    return Shares(owners, cells, around, foreign, np.array(sorted(pairs), int).reshape(-1, 2))


def _shared(lowest: AnyArray, tiles: AnyArray, tile: int, halo: float) -> AnyArray:
    """Which part of bricks lies in the ghost zones of tiles, each by its lowest cell, `[m]`."""
    low = np.maximum(lowest, tiles - halo)
    high = np.minimum(lowest + EDGE, tiles + tile + halo)
    return np.maximum(high - low, 0).prod(axis=1) / EDGE**3
