"""What a frame painted by tiles leaves to the next: as `RollState`, but out of memory."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.direction import Carried
from vnca.painting.tiles.kept import Keeping, Kept
from vnca.painting.unfinished import StoredState


@dataclass(frozen=True, eq=False)
class TiledState:
    """The state of a frame.

    Attributes:
        channels: How many numbers a cell has.
        kept: The cells alive, and their values; None if there are none.
        steps_done: As of `RollState`, and so
        frame: and
        carried: and
        layers: are these.
    """

    channels: int
    kept: Kept | None = None
    steps_done: int = 0
    frame: int | None = None
    carried: Carried | None = None
    layers: tuple["TiledState", ...] = ()

    def __len__(self) -> int:
        """How many cells are alive."""
        return 0 if self.kept is None else len(self.kept)

    def pieces(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Cells and their values, `[n, C]`, some at a time."""
        if self.kept is not None:
            yield from self.kept.pieces()

    @classmethod
    def of_stored(cls, stored: StoredState, folder: Path) -> "TiledState":
        """That of an unfinished painting, tiled or not.

        Raises:
            ValueError: If it is damaged.
        """
        channels = stored.roll.rule.config.channels
        keeping = Keeping(folder, channels)
        rest = np.empty((0, 3), np.int32), np.empty((0, channels), np.float32)
        for cells, values in stored.pieces():
            cells, values = np.concatenate([rest[0], cells]), np.concatenate([rest[1], values])
            # The last brick may go on in the next piece.
            others = (cells >> 3 != cells[-1] >> 3).any(axis=1)
            ended = int(np.flatnonzero(others)[-1]) + 1 if others.any() else 0
            _add(keeping, cells[:ended], values[:ended])
            rest = cells[ended:], values[ended:]
        _add(keeping, *rest)
        kept = keeping.kept()
        return cls(channels, kept if len(kept) else None, stored.steps_done, stored.frame)


def _add(keeping: Keeping, cells: IntArray, values: FloatArray) -> None:
    order = np.lexsort((cells >> 3).T[::-1])
    keeping.add(cells[order], values[order])
