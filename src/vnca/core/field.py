"""Values on a grid, kept only in the bricks where they are other than everywhere else."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, Index, IntArray
from vnca.core.bricks import (
    CELLS,
    EDGE,
    Places,
    bricks_beside,
    covered,
    places_in_bricks,
    runs_of_bricks,
    sorted_bricks,
)
from vnca.core.errors import GridError
from vnca.core.marks import Marks, packed, unpacked

MOST_CELLS = 2**27
"""A larger box (512³) becomes one array only if a good part of it holds something."""
_SPARSEST = 64  # cells of an array for each one stored
_VALUES_AT_ONCE = 2**22


@dataclass(frozen=True, eq=False)
class Field:
    """Values at the cells of a box; memory follows where they are, not how large the box is.

    Attributes:
        bricks: `[m, 3]` coordinates of the bricks, by x, then y, then z, each once.
        values: `[m, 8, 8, 8, ...]`; `outside` at cells beyond the box.
        box: The cells that there are.
        outside: The value where there is no brick.
    """

    bricks: IntArray
    values: AnyArray
    box: Box
    outside: Any = 0

    @classmethod
    def from_dense(
        cls, values: AnyArray, origin: Index, *, outside: Any = 0, held: BoolArray | None = None
    ) -> "Field":
        """The values `[x, y, z, ...]` of an array whose first cell has coordinates `origin`.

        Args:
            values: The array.
            origin: Index coordinates of its first cell.
            outside: The value of most.
            held: `[x, y, z]`, cells whose bricks are kept; those of another value unless given.
        """
        if held is None:
            held = np.asarray((values != outside).any(axis=tuple(range(3, values.ndim))))
        x, y, z = (start + cells for start, cells in zip(origin, values.shape, strict=False))
        before = [start % EDGE for start in origin]
        cells = zip(before, values.shape, strict=False)
        padding = [(gap, -(gap + count) % EDGE) for gap, count in cells]
        if any(map(any, padding)):
            wide = padding + [(0, 0)] * (values.ndim - 3)
            values = np.pad(values, wide, constant_values=outside)
            held = np.pad(held, padding)
        blocks = as_bricks(np.ascontiguousarray(values))
        # Eight booleans along z are one integer: much the fastest way to see who holds nothing.
        columns = np.ascontiguousarray(held).view(np.uint64)
        i, j, k = columns.shape
        at = np.argwhere(columns.reshape(i // EDGE, EDGE, j // EDGE, EDGE, k).any(axis=(1, 3)))
        first = [start // EDGE for start in origin]
        i, j, k = at.T
        return cls((at + first).astype(np.int32), blocks[i, j, k], Box(origin, (x, y, z)), outside)

    @classmethod
    def from_cells(
        cls, cells: IntArray, values: AnyArray, box: Box, *, outside: Any = 0
    ) -> "Field":
        """Values `[n, ...]` at cells `[n, 3]` of the box, each once."""
        return cls.all_from_cells(cells, box, (values, outside))[0]

    @classmethod
    def all_from_cells(
        cls, cells: IntArray, box: Box, *values: tuple[AnyArray, Any]
    ) -> "list[Field]":
        """As `from_cells`, of several values at the same cells, each with the one outside."""
        runs, lengths = runs_of_bricks(cells)
        bricks = sorted_bricks(runs)
        at, made = _flat_places(Places(bricks), runs, lengths, cells), []
        for each, outside in values:
            flat = np.empty((len(bricks) * CELLS, *each.shape[1:]), each.dtype)
            flat[...] = outside
            flat[at] = each
            flat = flat.reshape(-1, EDGE, EDGE, EDGE, *each.shape[1:])
            made.append(cls(bricks, flat, box, outside))
        return made

    @property
    def origin(self) -> Index:
        """Index coordinates of the lowest cell of the box."""
        return self.box.lower

    @property
    def shape(self) -> tuple[int, ...]:
        """That of the dense array."""
        return (*self.box.shape, *self.values.shape[4:])

    @cached_property
    def places(self) -> Places:
        """Where the bricks lie."""
        return Places(self.bricks)

    def blocks(self, bricks: AnyArray) -> AnyArray:
        """The values `[k, 8, 8, 8, ...]` in any bricks `[k, 3]`."""
        rows = self.places.find(bricks)
        if not len(self.bricks):
            return np.full((len(rows), *self.values.shape[1:]), self.outside, self.values.dtype)
        values = self.values.take(rows, axis=0, mode="clip")
        values[rows == len(self.bricks)] = self.outside
        return values

    def find(self, cells: IntArray) -> AnyArray:
        """Where cells `[n, 3]` stand in the values laid out flat: `[n]`, one by one.

        Where there is no brick, in one more that would follow the last.
        """
        return _flat_places(self.places, *runs_of_bricks(cells), cells)

    def gather(self, cells: IntArray) -> AnyArray:
        """The values `[n, ...]` at any cells `[n, 3]`."""
        kind = self.values.shape[4:]
        if not len(self.bricks):
            return np.full((len(cells), *kind), self.outside, self.values.dtype)
        at = self.find(cells)
        values = self.values.reshape(-1, *kind).take(at, axis=0, mode="clip")
        values[at >= len(self.bricks) * CELLS] = self.outside
        return values

    def shifted(self, axis: int, step: int) -> AnyArray:
        """The values `[m, 8, 8, 8, ...]` of the next cells along an axis, up or down by `step` 1.

        At the ends of what the bricks cover they are `outside`.
        """
        ahead = np.zeros(3, np.int32)
        ahead[axis] = step
        rows = self.places.find(self.bricks + ahead)
        there = np.flatnonzero(rows < len(self.bricks))
        low, high = slice(None, -1), slice(1, None)
        first, last = slice(0, 1), slice(-1, None)
        result = np.empty_like(self.values)
        within = [(low, high), (high, low)][step < 0]
        across = [(last, first), (first, last)][step < 0]
        (to, of), (end, begin) = ((_slab(axis, a), _slab(axis, b)) for a, b in (within, across))
        result[to] = self.values[of]
        result[end] = self.outside
        result[(there, *end[1:])] = self.values[(rows[there], *begin[1:])]
        return result

    def haloed(self) -> AnyArray:
        """Each brick with a layer of the cells around it, `[m, 10, 10, 10, ...]`."""
        wide = EDGE + 2
        shape = (len(self.bricks), wide, wide, wide, *self.values.shape[4:])
        result = np.full(shape, self.outside, self.values.dtype)
        to = {-1: slice(0, 1), 0: slice(1, -1), 1: slice(-1, None)}
        of = {-1: slice(-1, None), 0: slice(None), 1: slice(0, 1)}
        for offset in product((-1, 0, 1), repeat=3):
            rows = self.places.find(self.bricks + np.array(offset, np.int32))
            there = np.flatnonzero(rows < len(self.bricks))
            source = (rows[there], *(of[step] for step in offset))
            result[(there, *(to[step] for step in offset))] = self.values[source]
        return result

    def within(self, box: Box) -> "Field":
        """The same in the cells of a box, and nothing beyond."""
        box = self.box.intersection(box)
        first, last = covered(self.bricks, box)
        kept = (first < last).all(axis=1)
        first, last = first[kept], last[kept]
        cut = np.flatnonzero(((first > 0) | (last < EDGE)).any(axis=1))
        values = self.values[kept]
        along = np.arange(EDGE)
        # An axis and its places in the brick: `[k, 8]` each.
        x, y, z = (
            (along >= first[cut, axis, None]) & (along < last[cut, axis, None]) for axis in range(3)
        )
        beyond = ~(x[:, :, None, None] & y[:, None, :, None] & z[:, None, None, :])
        partial = values[cut]
        partial[beyond] = self.outside
        values[cut] = partial
        return replace(self, bricks=self.bricks[kept], values=values, box=box)

    def trimmed(self) -> "Field":
        """The same, without the bricks that hold nothing."""
        kept = (self.values != self.outside).any(axis=tuple(range(1, self.values.ndim)))
        if kept.all():
            return self
        return replace(self, bricks=self.bricks[kept], values=self.values[kept])

    def union(self, other: "Field") -> "Field":
        """Of two fields of booleans in one box: where either holds."""
        bricks = sorted_bricks(np.concatenate([self.bricks, other.bricks]))
        return replace(self, bricks=bricks, values=self.blocks(bricks) | other.blocks(bricks))

    def turned(self, order: Sequence[int], signs: Sequence[int] = (1, 1, 1)) -> "Field":
        """With other axes: axis `a` of the result is axis `order[a]` of this one.

        Where `signs[a]` is -1 it runs the other way: cell i becomes cell -1 - i.
        """
        if (*order, *signs) == (0, 1, 2, 1, 1, 1):
            return self
        lower, upper = [], []
        bricks = self.bricks[:, order]
        for axis, (source, sign) in enumerate(zip(order, signs, strict=True)):
            low, high = self.box.lower[source], self.box.upper[source]
            lower.append(low if sign > 0 else -high)
            upper.append(high if sign > 0 else -low)
            if sign < 0:
                bricks[:, axis] = -1 - bricks[:, axis]
        values = self.values.transpose(
            0, *(1 + axis for axis in order), *range(4, self.values.ndim)
        )
        values = values[(slice(None), *(slice(None, None, sign) for sign in signs))]
        box = Box((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))
        return replace(self, bricks=bricks, values=values, box=box).in_order()

    def in_order(self) -> "Field":
        """The same with its bricks as they must be, if they are not."""
        order = np.lexsort(self.bricks.T[::-1])
        return replace(self, bricks=self.bricks[order], values=self.values[order])

    def moved(self, by: Index) -> "Field":
        """With every cell so many cells farther along each axis."""
        whole = np.array([step // EDGE for step in by], np.int32)
        field = replace(self, bricks=self.bricks + whole, box=self.box.moved(by))
        for axis, step in enumerate(by):
            if rest := step % EDGE:
                field = field._moved_within_bricks(axis, rest)
        return field

    def _moved_within_bricks(self, axis: int, step: int) -> "Field":
        ahead = np.zeros(3, np.int32)
        ahead[axis] = 1
        bricks = sorted_bricks(np.concatenate([self.bricks, self.bricks + ahead]))
        low, high = _slab(axis, slice(None, step)), _slab(axis, slice(step, None))
        result = np.empty((len(bricks), *self.values.shape[1:]), self.values.dtype)
        result[high] = self.blocks(bricks)[_slab(axis, slice(None, -step))]
        result[low] = self.blocks(bricks - ahead)[_slab(axis, slice(-step, None))]
        return replace(self, bricks=bricks, values=result).trimmed()

    def dense(self, box: Box | None = None, *, what: str = "smoke") -> AnyArray:
        """The array `[x, y, z, ...]` over a box; over all cells unless given.

        Args:
            box: Which cells.
            what: What a message calls the field.

        Raises:
            GridError: If it would be far larger than what there is.
        """
        box = self.box if box is None else box
        cells = math.prod(box.shape)
        if cells > max(MOST_CELLS, len(self.bricks) * CELLS * _SPARSEST):
            raise GridError(
                f"{what}: scattered over cells {box.lower} to {box.upper}, too many for the arrays "
                "that pictures, training and fits take; remove what strays, or resample the grid"
            )
        aligned = Box(
            *(_aligned(corner, up) for corner, up in zip(box, (False, True), strict=True))
        )
        result = np.full((*aligned.shape, *self.values.shape[4:]), self.outside, self.values.dtype)
        at = self.bricks - np.array(aligned.lower, np.int64) // EDGE
        shape = np.array(aligned.shape) // EDGE
        inside = ((at >= 0) & (at < shape)).all(axis=1)
        i, j, k = at[inside].T
        as_bricks(result)[i, j, k] = self.values[inside]
        return np.ascontiguousarray(result[box.slices(aligned)])


def as_bricks(dense: AnyArray) -> AnyArray:
    """A view `[brick x, y, z, cell x, y, z, ...]` of an array aligned to bricks."""
    x, y, z = (cells // EDGE for cells in dense.shape[:3])
    split = dense.reshape(x, EDGE, y, EDGE, z, EDGE, *dense.shape[3:])
    return split.transpose(0, 2, 4, 1, 3, 5, *range(6, split.ndim))


def _slab(axis: int, part: slice) -> tuple[slice, ...]:
    """A part along one axis of values `[m, 8, 8, 8, ...]`."""
    return (slice(None), *(part if a == axis else slice(None) for a in range(3)))


def _aligned(corner: Index, up: bool) -> Index:
    x, y, z = ((cell + (EDGE - 1) * up) // EDGE * EDGE for cell in corner)
    return x, y, z


def _flat_places(places: Places, runs: AnyArray, lengths: AnyArray, cells: AnyArray) -> AnyArray:
    """Where cells lie in values laid out flat; in one brick more where there is none."""
    at = np.repeat(places.find(runs) * CELLS, lengths)
    at += places_in_bricks(cells)
    return at


def dilated(marked: Field, cells: int) -> Field:
    """Cells at most `cells` cells along each axis from one in a field of booleans, in its box."""
    bricks = bricks_beside(marked.bricks, -(-cells // EDGE))
    bits = Marks(bricks).dilated(packed(marked.blocks(bricks)), cells)
    held = bits.any(axis=1)
    grown = replace(marked, bricks=bricks[held], values=unpacked(bits[held]))
    return grown.within(marked.box).trimmed()


def refined(field: Field, factor: int) -> Field:
    """A field of floats on a grid `factor` times as fine along each axis.

    Interpolated linearly between the centres of cells; beyond the outermost of the box they stay.
    """
    held = (field.values != field.outside).any(axis=tuple(range(4, field.values.ndim)))
    near = dilated(replace(field, values=held, outside=False), 1)
    coarse = replace(field, bricks=near.bricks, values=field.blocks(near.bricks))
    box = field.box.refined(factor)
    finer = [
        replace(field, bricks=bricks, values=values, box=box).within(box).trimmed()
        for bricks, values in _finer_bricks(coarse, factor)
    ]
    if not finer:
        return replace(field, box=box)
    bricks = np.concatenate([part.bricks for part in finer])
    values = np.concatenate([part.values for part in finer])
    return replace(field, bricks=bricks, values=values, box=box).in_order()


def divided(field: Field, factor: int) -> Field:
    """A field on a grid `factor` times as fine: all parts of a cell hold what it held."""
    values = field.values
    for axis in range(1, 4):
        values = values.repeat(factor, axis)
    bricks, values = _cut(field.bricks, values, factor)
    return replace(field, bricks=bricks, values=values, box=field.box.refined(factor)).in_order()


def _finer_bricks(field: Field, factor: int) -> Iterator[tuple[AnyArray, AnyArray]]:
    """The finer bricks in some of the bricks at a time, and their values."""
    kind = field.values.shape[4:]
    count = max(1, _VALUES_AT_ONCE // int(np.prod((*kind, (EDGE * factor) ** 3))))
    around = _continued(field)
    for start in range(0, len(around), count):
        values = around[start : start + count]
        for axis in range(1, 4):
            values = _interpolated(values, axis, factor)
        yield _cut(field.bricks[start : start + count], values, factor)


def _cut(bricks: IntArray, values: AnyArray, factor: int) -> tuple[AnyArray, AnyArray]:
    """Finer bricks, and their values, of those of larger ones, `[m, 8 f, 8 f, 8 f, ...]`."""
    kind = values.shape[4:]
    parts = np.array(list(product(range(factor), repeat=3)), np.int32)
    blocks = values.reshape(-1, *(factor, EDGE) * 3, *kind)
    blocks = blocks.transpose(0, 1, 3, 5, 2, 4, 6, *range(7, blocks.ndim))
    finer = bricks[:, None] * np.int32(factor) + parts
    return finer.reshape(-1, 3), blocks.reshape(-1, EDGE, EDGE, EDGE, *kind)


def _continued(field: Field) -> AnyArray:
    """Bricks with a layer of the cells around them; beyond the box its outermost go on."""
    around = field.haloed()
    first, last = covered(field.bricks, field.box)
    lowest = field.bricks.astype(np.int64) * EDGE
    for axis in range(3):
        begins = lowest[:, axis] + first[:, axis] == field.box.lower[axis]
        ends = lowest[:, axis] + last[:, axis] == field.box.upper[axis]
        for place in range(EDGE):
            # Cell `place` of a brick is number `place + 1` with the layer around it.
            for rows, beyond in (
                (np.flatnonzero(begins & (first[:, axis] == place)), place),
                (np.flatnonzero(ends & (last[:, axis] == place + 1)), place + 2),
            ):
                to, of = [slice(None)] * 4, [slice(None)] * 4
                to[1 + axis], of[1 + axis] = slice(beyond, beyond + 1), slice(place + 1, place + 2)
                around[(rows, *to[1:])] = around[(rows, *of[1:])]
    return around


def _interpolated(values: AnyArray, axis: int, factor: int) -> AnyArray:
    """Values of ten cells along an axis at the finer cells in the inner eight."""
    at = (np.arange(factor * EDGE) + 0.5) / factor - 0.5
    below = np.floor(at)
    weight = (at - below).astype(np.float32).reshape(-1, *[1] * (values.ndim - axis - 1))
    places = below.astype(np.intp) + 1
    # In place: the finer arrays are the largest there are.
    result, step = values.take(places, axis), values.take(places + 1, axis)
    step -= result
    step *= weight
    result += step
    return result
