"""Parts of grids: those of their leaves that are wanted, of files larger than memory."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vnca.core import AnyArray, Box, IntArray
from vnca.core.bricks import covered, meeting
from vnca.core.field import Field
from vnca.io.vdb.grid import MOST_TILE_CELLS, Grid
from vnca.io.vdb.layout import LEAF_EDGE, Cursor
from vnca.io.vdb.tree import Leaves


@dataclass(eq=False, kw_only=True)
class GridPart(Grid):
    """A grid that holds nothing but what lies in some leaves around a part of its cells.

    Attributes:
        whole: The smallest box around all active cells of the grid.
        part: The cells that it holds.
    """

    whole: Box
    part: Box

    def active_box(self) -> Box:
        """That of the whole grid."""
        return self.whole

    def _fields(self, box: Box, near: IntArray | None) -> tuple[Field, Field]:
        found = super()._fields(box.intersection(self.part), near)
        values, active = (replace(field, box=box) for field in found)
        return values, active


@dataclass(frozen=True, eq=False)
class GridIndex:
    """A grid of a file, of which parts can be read.

    Attributes:
        grid: The grid without its leaves.
        leaves: Where those are.
        cursor_at: A cursor at a byte of the file.
    """

    grid: Grid
    leaves: Leaves
    cursor_at: Callable[[int], Cursor]

    @cached_property
    def active_box(self) -> Box:
        """The smallest box around the active cells; empty if there are none."""
        tree = self.grid.tree._replace(
            leaf_origins=self.leaves.origins, leaf_active=self.leaves.active
        )
        return replace(self.grid, tree=tree).active_box()

    @property
    def is_filled(self) -> bool:
        """Whether active tiles fill more than fits, so that they count near other cells only."""
        tiles = self.grid.tree.tiles
        return float((tiles.edges[tiles.active].astype(float) ** 3).sum()) > MOST_TILE_CELLS

    def holds(self, box: Box) -> bool:
        """Whether a leaf or an active tile meets a box."""
        tiles = self.grid.tree.tiles
        at = tiles.origins[tiles.active].astype(np.int64)
        ends = at + tiles.edges[tiles.active][:, None]
        return bool(
            meeting(self.leaves.origins // LEAF_EDGE, box).any()
            or ((at < box.upper) & (ends > box.lower)).all(axis=1).any()
        )

    def count(self, box: Box) -> float:
        """About how many active cells there are in a box."""
        first, last = covered(self.leaves.origins // LEAF_EDGE, box)
        share = np.prod(np.maximum(last - first, 0), axis=1) / LEAF_EDGE**3
        tiles = self.grid.tree.tiles
        at = tiles.origins[tiles.active].astype(np.int64)
        ends = at + tiles.edges[tiles.active][:, None]
        shared = np.maximum(np.minimum(ends, box.upper) - np.maximum(at, box.lower), 0)
        return float((share * self._counts).sum() + np.prod(shared, axis=1, dtype=float).sum())

    @cached_property
    def _counts(self) -> AnyArray:
        """`[m]` active cells of each leaf."""
        return self.leaves.active.reshape(len(self.leaves.origins), -1).sum(axis=1)

    def part(self, box: Box) -> GridPart:
        """The grid as far as it meets a box.

        Raises:
            FileFormatError: If a leaf there is corrupt.
            GridError: If the file has been closed.
        """
        chosen = np.flatnonzero(meeting(self.leaves.origins // LEAF_EDGE, box))
        grid, tree = self.grid, self.leaves.tree(self.cursor_at, chosen)
        return GridPart(
            *(grid.name, grid.value_type, grid.transform, tree, grid.metadata, grid.is_half),
            whole=self.active_box,
            part=box,
        )
