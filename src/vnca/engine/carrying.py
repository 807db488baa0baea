"""States carried from cells to cells, by how much what is upstream has moved.

Natively where the native extension is, else in numpy: `Domain.sources` says what is carried.
"""

from dataclasses import replace

import numpy as np

from vnca.core import FloatArray
from vnca.engine import native
from vnca.engine.domain import LEAST_SHARE, Domain

CHUNK = 1 << 14
"""Cells that numpy carries at a time: what that takes fits into a cache."""


def carried(
    state: FloatArray,
    before: Domain,
    after: Domain,
    moved: FloatArray,
    *,
    threads: int | None = None,
) -> FloatArray:
    """The state `[m + 1, C]` on other cells, once it has moved.

    Args:
        state: `[n + 1, C]`, the last row zero.
        before: Its cells.
        after: Those wanted.
        moved: `[m, 3]`, by how much it has come to each of them, cells.
        threads: Of the native core; one for each core unless given. The bits do not depend on it.

    Raises:
        ShapeError: If the native core refuses an array, such as movements that are not finite.
    """
    if native.unavailable() is not None:
        return carried_by_numpy(state, before, after, moved)
    result = np.empty((len(after) + 1, state.shape[1]), np.float32)
    rows = before.rows
    where = (*map(tuple, before.box), before.border == "circular", LEAST_SHARE)
    arrays = (state, rows.bricks, rows.values, *where, after.cells, moved, result)
    function = native.extension().carry
    native.checked("carrying", function, *arrays, threads or native.default_threads())
    return result


def carried_by_numpy(
    state: FloatArray, before: Domain, after: Domain, moved: FloatArray
) -> FloatArray:
    """As `carried`, readable."""
    result = np.zeros((len(after) + 1, state.shape[1]), state.dtype)
    for start in range(0, len(after), CHUNK):
        some = slice(start, start + CHUNK)
        rows, shares = before.sources(replace(after, cells=after.cells[some]), moved[some])
        for row, share in zip(rows, shares, strict=True):
            result[:-1][some] += share[:, None] * state[row]
    return result
