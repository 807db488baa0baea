"""Cells that other ranks keep around the tiles of one: ghost zones, and whatever else is fetched.

Which bricks are told once; their values as often as they change.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, Box, IntArray
from vnca.core.bricks import EDGE, meeting
from vnca.core.marks import unpacked
from vnca.painting.tiles.kept import BRICKS_AT_ONCE, Kept
from vnca.ranks import Ranks, Swap


class _Ghosts(NamedTuple):
    """Bricks of another rank: where they lie `[g, 3]`, their bits `[g, 8]` and cells `[g]`."""

    bricks: IntArray
    marks: AnyArray
    counts: AnyArray


class Near:
    """Bricks of others that meet boxes of this rank, and its own that meet theirs."""

    def __init__(self, ranks: Ranks, kept: Kept, wanted: Sequence[Box], edge: int) -> None:
        """Ask all ranks what they want, and tell them which bricks there are.

        Args:
            ranks: The ranks, all of which ask.
            kept: What this one keeps.
            wanted: Boxes of which it wants all cells.
            edge: Cells along the edge of a tile: who may have something is known by tiles.
        """
        self.ranks, self._kept = ranks, kept
        self._wanted_by: dict[int, AnyArray] = {}
        self._ghosts: dict[int, _Ghosts] = {}
        if ranks.size > 1:
            self._ask(wanted, edge)

    def _ask(self, wanted: Sequence[Box], edge: int) -> None:
        ranks, kept = self.ranks, self._kept
        held = np.unique(kept.bricks * EDGE // edge, axis=0) * edge
        told = ranks.every((held, np.array(wanted, np.int64).reshape(-1, 2, 3)))
        order = np.lexsort(kept.bricks.T)
        tables: dict[int, AnyArray] = {}
        for rank in ranks.others:
            if _meet(held, edge, boxes := told[rank][1]):
                inside = np.zeros(len(order), bool)
                for lower, upper in boxes.tolist():
                    inside |= meeting(kept.bricks[order], Box(lower, upper))
                self._wanted_by[rank] = np.flatnonzero(inside)
                some = order[inside]
                bits = kept.marks[some].view(np.int32)
                tables[rank] = np.concatenate([kept.bricks[some], bits], axis=1)
        mine = told[ranks.rank][1]
        counts = {r: np.empty(1, np.int64) for r in ranks.others if _meet(told[r][0], edge, mine)}
        ranks.swap({r: np.array([len(table)]) for r, table in tables.items()}, counts).wait()
        found = {r: np.empty((int(count[0]), 19), np.int32) for r, count in counts.items()}
        ranks.swap(tables, found).wait()
        for rank, table in found.items():
            marks = np.ascontiguousarray(table[:, 3:]).view(np.uint64)
            counted = unpacked(marks).sum(axis=(1, 2, 3))
            self._ghosts[rank] = _Ghosts(table[:, :3].copy(), marks, counted)

    @cached_property
    def known(self) -> Kept:
        """Where cells are, ghosts among them; not the values of those."""
        nowhere = {rank: [np.zeros_like(each.counts)] for rank, each in self._ghosts.items()}
        return self._joined(self._kept, nowhere)

    def touches(self, box: Box) -> bool:
        """Whether there are ghosts in a box."""
        return bool(meeting(self.known.bricks[len(self._kept.bricks) :], box).any())

    def begin(self, state: Kept) -> "Coming":
        """Begin to fetch the values of ghosts.

        Args:
            state: Values of the same bricks as when it was asked, in any order.
        """
        return Coming(self, state)

    def filled(self, state: Kept) -> Kept:
        """The values of this rank with those around; see `begin`."""
        return self.begin(state).wait()

    def _joined(self, state: Kept, firsts: Mapping[int, Sequence[AnyArray]]) -> Kept:
        """The bricks of a state, and the ghosts, with the rows of their first cells."""
        bricks, marks, rows = [state.bricks], [state.marks], [state.firsts]
        for rank, ghosts in self._ghosts.items():
            bricks.append(ghosts.bricks)
            marks.append(ghosts.marks)
            rows.extend(firsts[rank])
        return Kept(np.concatenate(bricks), np.concatenate(marks), np.concatenate(rows), state.rows)


class Coming:
    """Values of ghosts on their way, some bricks at a time."""

    def __init__(self, near: Near, state: Kept) -> None:
        """Begin with the first of them."""
        self._near, self._state, self._at = near, state, 0
        order = np.lexsort(state.bricks.T)
        self._going = {rank: order[some] for rank, some in near._wanted_by.items()}
        numbers = [*self._going.values(), *(g.counts for g in near._ghosts.values())]
        self._most = max(map(len, numbers), default=0)
        self._firsts: dict[int, list[AnyArray]] = {rank: [] for rank in near._ghosts}
        self._filled: Kept | None = None
        self._swap, self._arrays = self._next()

    def _next(self) -> tuple[Swap, dict[int, AnyArray]]:
        some = slice(self._at, self._at + BRICKS_AT_ONCE)
        width = self._state.rows.shape[1]
        arrays = {
            rank: np.empty((int(ghosts.counts[some].sum()), width), np.float32)
            for rank, ghosts in self._near._ghosts.items()
            if len(ghosts.counts[some])
        }
        going = {
            rank: self._state.values_of(bricks[some])
            for rank, bricks in self._going.items()
            if len(bricks[some])
        }
        return self._near.ranks.swap(going, arrays), arrays

    def poll(self) -> None:
        """See `Swap.poll`."""
        self._swap.poll()

    def wait(self) -> Kept:
        """Values with those of the ghosts, which are added to the same scratch file.

        Raises:
            RankError: If a rank ended before.
        """
        while self._filled is None:
            self._swap.wait()
            for rank, array in self._arrays.items():
                counts = self._near._ghosts[rank].counts[self._at : self._at + BRICKS_AT_ONCE]
                first = self._state.rows.append(array)
                self._firsts[rank].append(first + np.cumsum(counts) - counts)
            self._at += BRICKS_AT_ONCE
            if self._at < self._most:
                self._swap, self._arrays = self._next()
            else:
                self._filled = self._near._joined(self._state, self._firsts)
        return self._filled


def _meet(tiles: AnyArray, edge: int, boxes: AnyArray) -> bool:
    """Whether a cube whose lowest cell is among `[t, 3]` meets one of the boxes `[b, 2, 3]`."""
    lower, upper = boxes[None, :, 0], boxes[None, :, 1]
    return bool(((tiles[:, None] < upper) & (tiles[:, None] + edge > lower)).all(-1).any())
