"""Which cells are active: those near the smoke or in all of its box, in index space."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, FloatArray, Index, IntArray
from vnca.core.bricks import EDGE, cells_at, runs_of_bricks
from vnca.core.errors import OptionError
from vnca.core.field import Field, dilated
from vnca.engine.automaton import OFFSETS, HashArray, hash_cells

MOST_CELLS = 2**27
"""A larger box (512³) may not be active as a whole."""

LEAST_SHARE = 0.25
"""What must be alive upstream of a cell for it to have its state from there."""

_WIDE = EDGE + 2
_STRIDES = np.array([_WIDE**2, _WIDE, 1], np.int32)

Border = Literal["replicate", "circular"]
DomainKind = Literal["active", "box"]
"""Cells near the smoke, or all cells of its box."""


class Around(NamedTuple):
    """Where the neighbours of cells are: a hundredth of the bytes of a list for each cell.

    Attributes:
        rows: `[m, 10, 10, 10]` rows of the state in each brick of 8³ and in the layer around it,
            z fastest; n for the outside.
        places: `[n]` where each cell lies in those, laid out flat.
    """

    rows: IntArray
    places: IntArray


@dataclass(frozen=True, eq=False)
class Domain:
    """Cells that are alive, as a list; the states of an automaton are kept in its order.

    A state over a domain is `[n + 1, C]`: a row a cell, and a last row of zeros that stands for
    everything that is not active. Cost and memory follow the smoke, not its box.

    Attributes:
        cells: `[n, 3]` index coordinates, all inside `box`, each once; brick by brick, so that
            neighbours in space are neighbours in memory.
        box: Beyond its border neighbours are repeated or wrapped, even for the outside.
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
        field = Field.from_dense(alive, origin)
        return cls(cells_at(field.bricks, field.values), box or field.box, border)

    @classmethod
    def around_smoke(cls, density: Field, *, threshold: float, dilation: int, box: Box) -> "Domain":
        """Cells of `box` at most `dilation` cells (along each axis) from density over `threshold`.

        Dilation makes a cell active for a while before smoke arrives in it.
        """
        smoke = replace(density, values=density.values > threshold, outside=False)
        smoke = smoke.within(box).trimmed()
        alive = dilated(replace(smoke, box=smoke.box.grown(dilation).intersection(box)), dilation)
        return cls(cells_at(alive.bricks, alive.values), box)

    @classmethod
    def filling(cls, box: Box) -> "Domain":
        """All cells of a box.

        Raises:
            OptionError: If there are too many.
        """
        cls.require_fillable(box)
        return cls.from_mask(np.ones(box.shape, dtype=bool), box.lower)

    @classmethod
    def require_fillable(cls, box: Box) -> None:
        """Refuse a box of too many cells to be active as a whole.

        Raises:
            OptionError: If it has too many.
        """
        if math.prod(box.shape) > MOST_CELLS:
            raise OptionError(
                f"`domain` box: the box of the smoke, {box.lower} to {box.upper}, has "
                f"{math.prod(box.shape)} cells, and at most {MOST_CELLS} can be active; "
                "use `domain` active"
            )

    def within(self, box: Box) -> "Domain":
        """Those of its cells that lie in a box."""
        inside = ((self.cells >= box.lower) & (self.cells < box.upper)).all(axis=1)
        return replace(self, cells=self.cells[inside])

    def __len__(self) -> int:
        """Number of cells alive."""
        return len(self.cells)

    @cached_property
    def rows(self) -> Field:
        """The row of each cell in the state, n for the outside."""
        rows = np.arange(len(self), dtype=np.int32)
        return Field.from_cells(self.cells, rows, self.box, outside=np.int32(len(self)))

    @cached_property
    def around(self) -> Around:
        """The rows of the state in the bricks of the cells and around them."""
        runs, lengths = runs_of_bricks(self.cells)
        bricks = self.rows.bricks
        rows = self.rows.haloed()
        lower, upper = np.asarray(self.box.lower), np.asarray(self.box.upper)
        first = bricks * EDGE - 1
        # What lies beyond the border of the box is repeated or wrapped, for places outside, too.
        border = np.flatnonzero(((first < lower) | (first + _WIDE > upper)).any(axis=1))
        at = first[border, None] + np.indices(3 * (_WIDE,), np.int32).reshape(3, -1).T
        beyond = ((at < lower) | (at >= upper)).any(axis=-1)
        cells = at[beyond]
        if self.border == "replicate":
            cells = cells.clip(lower, upper - 1)
        else:
            cells = (cells - lower) % (upper - lower) + lower
        shown = rows[border].reshape(len(border), _WIDE**3)
        shown[beyond] = self.rows.gather(cells.astype(np.int32))
        rows[border] = shown.reshape(-1, *rows.shape[1:])
        places = np.repeat(self.rows.places.find(runs) * _WIDE**3, lengths)
        places += ((self.cells & (EDGE - 1)) + 1) @ _STRIDES
        return Around(rows, places.astype(np.int32))

    @cached_property
    def neighbours(self) -> IntArray:
        """`[27, n]` rows of the state around each cell, n for the outside."""
        rows, places = self.around
        result = np.empty((len(OFFSETS), len(self)), np.int32)
        for row, step in zip(result, OFFSETS @ _STRIDES, strict=True):
            np.take(rows.reshape(-1), places + step, out=row, mode="clip")
        return result

    def corners(self, points: AnyArray) -> tuple[IntArray, FloatArray]:
        """Between which cells points lie, as decoding wants to know.

        Args:
            points: `[m, 3]` index coordinates, finite; cell `[i, j, k]` has its centre there.

        Returns:
            Rows `[8, m]` of the state around each point, z fastest, n for the outside; and
            `[m, 3]` how far it lies from the first of these cells to the last, 0 to 1.
        """
        first = np.floor(points)
        fractions = np.ascontiguousarray(points - first, np.float32)
        rows = self._rows_at(first + np.array(list(product((0, 1), repeat=3)))[:, None])
        return rows, fractions

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

    def scatter(self, values: AnyArray, box: Box) -> AnyArray:
        """Dense `[x, y, z, ...]` over `box` of values `[n, ...]`, zero where no cell is active."""
        at = self.cells - np.asarray(box.lower, dtype=np.int32)
        reached = ((at >= 0) & (at < box.shape)).all(axis=1)
        field = np.zeros((*box.shape, *values.shape[1:]), dtype=values.dtype)
        field[tuple(at[reached].T)] = values[reached]
        return field

    def carry(self, state: AnyArray, other: "Domain") -> AnyArray:
        """The state on `other`: cells alive in both keep theirs, new ones start from zero."""
        rows = self.rows.gather(other.cells)
        return state[np.append(rows, np.int32(len(self)))]

    def sources(self, other: "Domain", moved: AnyArray) -> tuple[IntArray, FloatArray]:
        """Where the cells of `other` have their state from, once it has been moved: upstream.

        A state there is interpolated cubically, along z, then y, then x; a cell that is not alive
        counts as the next that is. A cell that would have little or nothing keeps its own.

        Args:
            other: The cells that want a state.
            moved: `[m, 3]`, by how much it has come to each of them, cells.

        Returns:
            Rows `[64, m]` of the state here, n for the outside, and their shares `[64, m]`.

        Reference: Stam 1999, section 2.3 (semi-Lagrangian advection); Catmull & Rom 1974.
        """
        points = other.cells - moved
        first = np.floor(points)
        rows = self._rows_at(first + np.array(list(product(range(-1, 3), repeat=3)))[:, None])
        rows = rows.reshape(4, 4, 4, -1)
        alive = rows < len(self)
        x, y, z = np.ascontiguousarray((points - first).T, np.float32)
        inner = zip(
            product((1 - x, x), (1 - y, y), (1 - z, z)), product((1, 2), repeat=3), strict=True
        )
        total = sum(alive[at] * a * b * c for (a, b, c), at in inner)
        shares, lines = _cubic(z, alive)
        along_y, planes = _cubic(y, lines)
        along_x, _ = _cubic(x, planes)
        shares *= along_y[:, :, None]
        shares *= along_x[:, None, None]
        rows, shares = rows.reshape(64, -1), shares.reshape(64, -1)
        from_outside = total < LEAST_SHARE
        shares[:, from_outside] = np.eye(64, 1, dtype=np.float32)
        rows[0, from_outside] = self.rows.gather(other.cells[from_outside])
        return rows, shares

    def _rows_at(self, cells: AnyArray) -> IntArray:
        """Rows `[k, m]` of the cells at whole index coordinates `[k, m, 3]`, inside or beyond."""
        lower, upper = np.asarray(self.box.lower), np.asarray(self.box.upper)
        if self.border == "replicate":
            cells = cells.clip(lower, upper - 1)
        else:
            cells = (cells - lower) % (upper - lower) + lower
        return self.rows.gather(cells.astype(np.int32).reshape(-1, 3)).reshape(len(cells), -1)


def _cubic(t: FloatArray, alive: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Shares of four cells along an axis for places between the two in the middle.

    Args:
        t: `[m]` how far from the second to the third.
        alive: `[..., 4, m]`; a cell that is not counts as the next that is.

    Returns:
        `[..., 4, m]`, and whether one of the two in the middle is alive, `[..., m]`.
    """
    first, second, third, fourth = np.moveaxis(alive, -2, 0)
    shares = np.empty((4, *first.shape), np.float32)
    shares[0] = ((2 - t) * t - 1) * t / 2
    shares[1] = ((3 * t - 5) * t * t + 2) / 2
    shares[2] = ((4 - 3 * t) * t + 1) * t / 2
    shares[3] = (t - 1) * t * t / 2
    for outer, inner, there in ((0, 1, first & second), (3, 2, third & fourth)):
        shares[inner] += np.where(there, 0, shares[outer])
        shares[outer] *= there
    shares[1], shares[2] = (
        second * (shares[1] + ~third * shares[2]),
        third * (shares[2] + ~second * shares[1]),
    )
    return np.moveaxis(shares, 0, -2), second | third


def subdivided(cells: IntArray, neighbours: IntArray, factor: int) -> tuple[IntArray, FloatArray]:
    """Where the centres of the parts of some cells lie, cell by cell, z fastest.

    Args:
        cells: `[m]` rows of the cells.
        neighbours: `[27, n]` rows of the state around each cell; n for the outside.
        factor: Parts along each axis of a cell.

    Returns:
        Rows `[8, m · factor³]` of the cells around each centre, and `[m · factor³, 3]` how far it
        lies from the first of them to the last.
    """
    corners = np.array(list(product((0, 1), repeat=3)))
    parts = np.array(list(product(range(factor), repeat=3)))
    twice = 2 * parts + 1 - factor  # from the centre of the cell, in halves of a part
    lower = np.where(twice < 0, -1, 0)
    fractions = (twice / (2 * factor) - lower).astype(np.float32)
    around = lower + corners[:, None]  # [8, factor³, 3] offsets of neighbours
    numbers = (around + 1) @ np.array([9, 3, 1])  # in the order of `OFFSETS`
    rows = neighbours[numbers[:, None, :], cells[:, None]]
    return rows.reshape(len(corners), -1), np.tile(fractions, (len(cells), 1))
