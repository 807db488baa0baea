"""Carrying a state along with the smoke, from a frame to the next.

Each cell takes what was upstream of it, a midpoint step back along the velocity.

Reference: Stam 1999, section 2.3 (semi-Lagrangian advection).
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from vnca.core import FloatArray
from vnca.core.field import Field
from vnca.direction.mixing import Answer
from vnca.engine.domain import Domain
from vnca.io.velocity import carried_to

CHUNK = 1 << 15
"""Cells that are carried at a time: what that takes fits into a cache."""


def transported(
    state: FloatArray,
    before: Domain,
    after: Domain,
    velocity: Field,
    frames: Answer,
    *,
    threads: int | None = None,
) -> FloatArray:
    """The state `[m + 1, C]` on other cells, after the velocity has carried it for some time.

    Args:
        state: `[n + 1, C]`.
        before: Its cells.
        after: Those wanted.
        velocity: `[..., 3]`, cells per frame.
        frames: The time, one or of each cell `[m]`; below zero it goes back.
        threads: How many carry; one a core unless given. The result is the same to the bit.
    """
    known = replace(velocity, values=velocity.values.any(axis=-1), outside=False)
    time = np.broadcast_to(np.float32(frames), len(after))[:, None]
    carried = np.zeros((len(after) + 1, state.shape[1]), state.dtype)
    _ = before.rows  # found once, not by each thread

    def carry(start: int) -> None:
        some = slice(start, start + CHUNK)
        cells = after.cells[some]
        moved = carried_to(cells, velocity, known, time[some])
        rows, shares = before.sources(replace(after, cells=cells), moved)
        for row, share in zip(rows, shares, strict=True):
            carried[:-1][some] += share[:, None] * state[row]

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(carry, range(0, len(after), CHUNK)))
    return carried
