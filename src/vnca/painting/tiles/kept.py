"""Values of cells out of memory, found by the bricks that the cells lie in."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, Box, FloatArray, IntArray
from vnca.core.bricks import cells_at, meeting
from vnca.core.field import Field
from vnca.core.marks import packed, unpacked
from vnca.core.scratch import Scratch

BRICKS_AT_ONCE = 4096


@dataclass(frozen=True, eq=False)
class Kept:
    """Values of cells in a scratch file.

    Attributes:
        bricks: `[m, 3]` coordinates of those that hold cells, in any order, each once.
        marks: `[m, 8]` bits, which cells.
        firsts: `[m]` row of the first cell of each.
        rows: The values, brick by brick, each in the order of a `Domain`.
    """

    bricks: IntArray
    marks: AnyArray
    firsts: AnyArray
    rows: Scratch

    def __len__(self) -> int:
        """How many cells there are."""
        return int(self.counts.sum())

    @cached_property
    def counts(self) -> AnyArray:
        """`[m]` cells of each brick."""
        return unpacked(self.marks).sum(axis=(1, 2, 3))

    def holds(self, box: Box) -> bool:
        """Whether there may be cells in a box."""
        return bool(meeting(self.bricks, box).any())

    def within(self, box: Box) -> tuple[IntArray, FloatArray]:
        """The cells `[n, 3]` in a box, in the order of a `Domain`, and their values `[n, C]`."""
        some = np.flatnonzero(meeting(self.bricks, box))
        some = some[np.lexsort(self.bricks[some].T[::-1])]
        cells, values = self._of(some)
        inside = ((cells >= box.lower) & (cells < box.upper)).all(axis=1)
        if inside.all():
            return cells, values
        return cells[inside], values[inside]

    def pieces(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """All cells and their values, some at a time."""
        for start in range(0, len(self.bricks), BRICKS_AT_ONCE):
            yield self._of(np.arange(start, min(start + BRICKS_AT_ONCE, len(self.bricks))))

    def values_of(self, some: AnyArray) -> FloatArray:
        """The values `[n, C]` in some of the bricks, given by their numbers."""
        counts = self.counts[some]
        begins = np.cumsum(counts) - counts
        rows = np.repeat(self.firsts[some] - begins, counts) + np.arange(counts.sum())
        return self.rows[rows]

    def _of(self, some: AnyArray) -> tuple[IntArray, FloatArray]:
        cells = cells_at(self.bricks[some], unpacked(self.marks[some]))
        return cells, self.values_of(some)


@dataclass(eq=False)
class Keeping:
    """Values of cells on their way there.

    Attributes:
        folder: Where the scratch file is.
        width: How many numbers a cell has.
    """

    folder: Path
    width: int
    _bricks: list[IntArray] = field(default_factory=list, init=False)
    _marks: list[AnyArray] = field(default_factory=list, init=False)
    _firsts: list[AnyArray] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        self._rows = Scratch(self.folder, (self.width,))

    def add(self, cells: IntArray, values: FloatArray) -> None:
        """Some cells `[n, 3]`, in the order of a `Domain`: all those of the bricks they lie in.

        Raises:
            OutputError: If there is no room.
            ValueError: If they are in another order.
        """
        if not len(cells):
            return
        low, high = cells.min(axis=0).tolist(), (cells.max(axis=0) + 1).tolist()
        box = Box((low[0], low[1], low[2]), (high[0], high[1], high[2]))
        marked = Field.from_cells(cells, np.ones(len(cells), bool), box, outside=False)
        if not np.array_equal(cells_at(marked.bricks, marked.values), cells):
            raise ValueError("cells in another order than a domain's")
        counts = marked.values.sum(axis=(1, 2, 3))
        self._firsts.append(len(self._rows) + np.cumsum(counts) - counts)
        self._bricks.append(marked.bricks)
        self._marks.append(packed(marked.values))
        self._rows.append(values)

    def kept(self) -> Kept:
        """All of them.

        Raises:
            ValueError: If two times cells of one brick were added.
        """
        bricks = np.concatenate([np.empty((0, 3), np.int32), *self._bricks])
        if len(np.unique(bricks, axis=0)) < len(bricks):
            raise ValueError("cells of a brick lie apart")
        marks = np.concatenate([np.empty((0, 8), np.uint64), *self._marks])
        firsts = np.concatenate([np.empty(0, np.int64), *self._firsts])
        return Kept(bricks, marks, firsts, self._rows)
