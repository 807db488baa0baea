"""Fields on finer grids."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from vnca.core.bricks.field import Field
from vnca.core.bricks.growth import dilated
from vnca.core.bricks.places import EDGE, covered
from vnca.core.typing import AnyArray, IntArray

_VALUES_AT_ONCE = 2**22


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
