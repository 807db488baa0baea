"""Carrying a state along with the smoke, from a frame to the next."""

from dataclasses import replace

import numpy as np

from vnca.core import FloatArray
from vnca.core.field import Field
from vnca.direction.mixing import Answer
from vnca.engine.domain import Domain
from vnca.io.velocity import interpolated


def transported(
    state: FloatArray, before: Domain, after: Domain, velocity: Field, frames: Answer
) -> FloatArray:
    """The state `[m + 1, C]` on other cells, after the velocity has carried it for some time.

    Args:
        state: `[n + 1, C]`.
        before: Its cells.
        after: Those wanted.
        velocity: `[..., 3]`, cells per frame.
        frames: The time, one or of each cell `[m]`; below zero it goes back.
    """
    rows, shares = before.sources(after, _moved(after, velocity, frames))
    carried = np.zeros((len(after) + 1, state.shape[1]), state.dtype)
    for row, share in zip(rows, shares, strict=True):
        carried[:-1] += share[:, None] * state[row]
    return carried


def _moved(domain: Domain, velocity: Field, frames: Answer) -> FloatArray:
    """By how much what is at each cell has come to it, `[m, 3]`: a midpoint step back."""
    time = np.broadcast_to(np.float32(frames), len(domain))[:, None]
    moved = time * velocity.gather(domain.cells)
    known = replace(velocity, values=velocity.values.any(axis=-1), outside=False)
    halfway, found = interpolated(velocity, known, domain.cells - 0.5 * moved)
    moved[found] = time[found] * halfway[found]
    return moved
