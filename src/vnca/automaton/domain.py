"""Where cells live: within reach of the smoke or in all of its box, in index space."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from vnca.errors import OptionError
from vnca.kernels.update.mask import HashArray, hash_cells
from vnca.kernels.update.stencil import OFFSETS
from vnca.typing import AnyArray, BoolArray, Box, FloatArray, Index, IntArray

BRICK = 8
"""Cells are listed brick by brick, so that neighbours in space are neighbours in memory."""

MOST_CELLS = 2**27
"""A larger box (512³) may not live as a whole."""

Border = Literal["replicate", "circular"]
DomainKind = Literal["active", "box"]
"""Cells within reach of the smoke, or all cells of its box."""


@dataclass(frozen=True, eq=False)
class Domain:
    """Cells that are alive, as a list; the states of an automaton are kept in its order.

    A state over a domain is `[n + 1, C]`: a row a cell, and a last row of zeros that stands for
    everything that does not live. Cost and memory follow the smoke, not its box.

    Attributes:
        cells: `[n, 3]` index coordinates, all inside `box`, each once.
        box: Beyond its border neighbours are repeated or wrapped, even where nothing lives.
        border: What a cell at the border of the box sees beyond it.
    """

    cells: IntArray
    box: Box
    border: Border = "replicate"

    @classmethod
    def from_mask(
        cls,
        alive: BoolArray,
        origin: Index,
        *,
        box: Box | None = None,
        border: Border = "replicate",
    ) -> "Domain":
        """The cells where `alive[x, y, z]` holds; `origin` is the index of `alive[0, 0, 0]`.

        The box is that of the array unless given.
        """
        cells = np.argwhere(alive).astype(np.int32) + np.asarray(origin, dtype=np.int32)
        bricks = cells // BRICK
        order = np.lexsort((*cells.T[::-1], *bricks.T[::-1]))
        x, y, z = (o + n for o, n in zip(origin, alive.shape, strict=True))
        return cls(cells[order], box or Box(origin, (x, y, z)), border)

    @classmethod
    def around_smoke(
        cls, density: FloatArray, origin: Index, *, threshold: float, reach: int, box: Box
    ) -> "Domain":
        """Cells of `box` at most `reach` cells (along each axis) from density over `threshold`.

        The reach lets a cell live for a while before smoke arrives in it.
        """
        x, y, z = (o + n for o, n in zip(origin, density.shape, strict=True))
        inside = Box(origin, (x, y, z)).grown(reach).intersection(box)
        smoke = np.zeros(inside.shape, dtype=bool)
        covered = Box(origin, (x, y, z)).intersection(box)
        if not covered.is_empty:
            part = density[covered.slices(Box(origin, (x, y, z)))]
            smoke[covered.slices(inside)] = part > threshold
        return cls.from_mask(dilate(smoke, reach), inside.lower, box=box)

    @classmethod
    def filling(cls, box: Box) -> "Domain":
        """All cells of a box.

        Raises:
            OptionError: If there are too many.
        """
        if math.prod(box.shape) > MOST_CELLS:
            raise OptionError(
                f"--domain box: the box of the smoke, {box.lower} to {box.upper}, has "
                f"{math.prod(box.shape)} cells, and at most {MOST_CELLS} can live; "
                "use --domain active"
            )
        return cls.from_mask(np.ones(box.shape, dtype=bool), box.lower)

    def __len__(self) -> int:
        """Number of cells alive."""
        return len(self.cells)

    @cached_property
    def _extent(self) -> Box:
        """Around the cells with a margin of one: the box of a whole sequence may be far larger."""
        if len(self) == 0:
            return Box((0, 0, 0), (1, 1, 1))
        x, y, z = self.cells.min(axis=0).tolist()
        u, v, w = (self.cells.max(axis=0) + 1).tolist()
        return Box((x, y, z), (u, v, w)).grown(1)

    @cached_property
    def neighbours(self) -> IntArray:
        """`[27, n]` rows of the state around each cell, n where nothing lives."""
        box = self.box
        if self.border == "replicate" and len(self):
            box = self._extent.intersection(self.box)
        lower = np.asarray(box.lower)
        row_of = np.full(box.shape, len(self), dtype=np.int32)
        row_of[tuple((self.cells - lower).T)] = np.arange(len(self), dtype=np.int32)
        mode = "edge" if self.border == "replicate" else "wrap"
        row_of = np.pad(row_of, 1, mode=mode)
        strides = np.array([row_of.shape[1] * row_of.shape[2], row_of.shape[2], 1])
        flat = (self.cells - lower + 1) @ strides
        return row_of.ravel()[(OFFSETS @ strides)[:, None] + flat]

    @cached_property
    def places(self) -> AnyArray:
        """`[n]` where each cell lies in its box, if that is laid out flat."""
        at = self.cells - np.asarray(self.box.lower)
        return np.asarray(np.ravel_multi_index(tuple(at.T), self.box.shape))

    @cached_property
    def hashes(self) -> HashArray:
        """`[n]` hash of each cell's index coordinates, for the update mask."""
        return hash_cells(self.cells)

    def seed(self, channels: int) -> FloatArray:
        """The state every rollout starts from: zeros `[n + 1, channels]`."""
        return np.zeros((len(self) + 1, channels), dtype=np.float32)

    def gather(self, field: AnyArray, origin: Index, *, outside: float = 0.0) -> AnyArray:
        """Values `[n, ...]` of a dense field at the cells, `outside` where it does not reach."""
        at = self.cells - np.asarray(origin, dtype=np.int32)
        reached = ((at >= 0) & (at < field.shape[:3])).all(axis=1)
        values = np.full((len(self), *field.shape[3:]), outside, dtype=field.dtype)
        values[reached] = field[tuple(at[reached].T)]
        return values

    def scatter(self, values: AnyArray, box: Box) -> AnyArray:
        """Dense `[x, y, z, ...]` over `box` of values `[n, ...]`, zero where nothing lives."""
        at = self.cells - np.asarray(box.lower, dtype=np.int32)
        reached = ((at >= 0) & (at < box.shape)).all(axis=1)
        field = np.zeros((*box.shape, *values.shape[1:]), dtype=values.dtype)
        field[tuple(at[reached].T)] = values[reached]
        return field

    def carry(self, state: AnyArray, other: "Domain") -> AnyArray:
        """The state on `other`: cells alive in both keep theirs, new ones start from zero."""
        box = self._extent.union(other._extent)
        lower, shape = np.asarray(box.lower), box.shape
        row_of = np.full(int(np.prod(shape)), len(self), dtype=np.int32)
        row_of[np.ravel_multi_index(tuple((self.cells - lower).T), shape)] = np.arange(len(self))
        rows = row_of[np.ravel_multi_index(tuple((other.cells - lower).T), shape)]
        return state[np.append(rows, len(self))]


def dilate(mask: BoolArray, reach: int) -> BoolArray:
    """Cells at most `reach` cells along each axis from one in `mask`; axes do not wrap."""
    for axis in range(mask.ndim):
        grown = mask.copy()
        for shift in range(1, min(reach, mask.shape[axis] - 1) + 1):
            ahead = [slice(None)] * mask.ndim
            behind = [slice(None)] * mask.ndim
            ahead[axis], behind[axis] = slice(shift, None), slice(None, -shift)
            grown[tuple(ahead)] |= mask[tuple(behind)]
            grown[tuple(behind)] |= mask[tuple(ahead)]
        mask = grown
    return mask
