"""Carrying a state along with the smoke, from a frame to the next.

Each cell takes what was upstream of it, a midpoint step back along the velocity.

Reference: Stam 1999, section 2.3 (semi-Lagrangian advection).
"""

from vnca.core import FloatArray
from vnca.core.field import Field
from vnca.direction.mixing import Answer
from vnca.engine.carrying import carried
from vnca.engine.domain import Domain
from vnca.io.velocity import carried_to


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
    moved = carried_to(after.cells, velocity, frames, threads=threads)
    return carried(state, before, after, moved, threads=threads)
