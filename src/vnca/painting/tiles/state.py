"""What a frame painted by tiles leaves to the next: as `RollState`, but out of memory."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.direction import Carried
from vnca.painting.tiles.kept import Keeping, Kept
from vnca.painting.unfinished import StoredState
from vnca.ranks import Alone, Ranks

_SHARED = 64
"""Cells along the edge of the cubes that ranks share where a state is read."""


@dataclass(frozen=True, eq=False)
class TiledState:
    """The state of a frame.

    Attributes:
        channels: How many numbers a cell has.
        kept: The cells alive, and their values; None if there are none. Of several ranks, those
            that one keeps.
        alive: How many cells are alive, on all ranks.
        steps_done: As of `RollState`, and so
        frame: and
        carried: and
        layers: are these.
    """

    channels: int
    kept: Kept | None = None
    alive: int = 0
    steps_done: int = 0
    frame: int | None = None
    carried: Carried | None = None
    layers: tuple["TiledState", ...] = ()

    def __len__(self) -> int:
        """How many cells are alive."""
        return self.alive

    def pieces(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Cells and their values, `[n, C]`, some at a time."""
        if self.kept is not None:
            yield from self.kept.pieces()

    @classmethod
    def of_stored(
        cls, stored: StoredState, folder: Path, ranks: Ranks | None = None
    ) -> "TiledState":
        """That of an unfinished painting, tiled or not, with however many ranks.

        Args:
            stored: What was kept.
            folder: Where scratch files are.
            ranks: Who shares it; each keeps bricks that lie together.

        Raises:
            ValueError: If it is damaged.
        """
        channels = stored.roll.rule.config.channels
        keeping, alive, ranks = Keeping(folder, channels), 0, ranks or Alone()
        rest = np.empty((0, 3), np.int32), np.empty((0, channels), np.float32)
        for cells, values in stored.pieces():
            cells, values = np.concatenate([rest[0], cells]), np.concatenate([rest[1], values])
            # The last brick may go on in the next piece.
            others = (cells >> 3 != cells[-1] >> 3).any(axis=1)
            ended = int(np.flatnonzero(others)[-1]) + 1 if others.any() else 0
            _add(keeping, *_own(ranks, cells[:ended], values[:ended]))
            rest = cells[ended:], values[ended:]
            alive += ended
        _add(keeping, *_own(ranks, *rest))
        alive += len(rest[0])
        kept = keeping.kept() if alive else None
        return cls(channels, kept, alive, stored.steps_done, stored.frame)

    def gathered(self, folder: Path, ranks: Ranks) -> "TiledState":
        """The same with what all ranks keep, at the first; at others as it is.

        Raises:
            OutputError: If there is no room.
        """
        layers = tuple(layer.gathered(folder, ranks) for layer in self.layers)
        if ranks.size == 1 or self.kept is None:
            return replace(self, layers=layers)
        keeping = Keeping(folder, self.channels)
        if ranks.leads:
            for piece in self.pieces():
                _add(keeping, *piece)
        ranks.gather(self.pieces(), lambda piece: _add(keeping, *piece))
        return replace(self, kept=keeping.kept() if ranks.leads else self.kept, layers=layers)


def _own(ranks: Ranks, cells: IntArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    own = (cells // _SHARED).sum(axis=1) % ranks.size == ranks.rank
    return cells[own], values[own]


def _add(keeping: Keeping, cells: IntArray, values: FloatArray) -> None:
    order = np.lexsort((cells >> 3).T[::-1])
    keeping.add(cells[order], values[order])
