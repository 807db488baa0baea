"""How far a painting may change the outline of the smoke, and its mass."""

from typing import Literal

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.field import Field
from vnca.direction.mixing import Answer, eased

Silhouette = Literal["free", "soft", "keep"]
"""Whether the density at the edge of the smoke is changed as inside of it, half as much, or not."""
_HELD: dict[Silhouette, float] = {"free": 0.0, "soft": 0.5, "keep": 1.0}
RIM = 3.0
"""Cells below the surface from which on density is changed as the painting has it."""
_STRONGEST = 0.5
"""A factor is from 1 − this to 1 + this, with a density strength of 1."""


def outlined(
    factors: FloatArray, depth: AnyArray, silhouette: Silhouette, edge: Answer
) -> FloatArray:
    """Factors of the density as the outline lets them be.

    Args:
        factors: `[n]`, of the painting.
        depth: `[n]`, below the surface of the smoke, in its cells.
        silhouette: How far the painting may change the outline.
        edge: By how many cells the outline is moved inwards where it is below zero: twice as far
            where the painting thins the smoke, not at all where it thickens it. What lies beyond
            is gone.
    """
    result = factors
    if held := _HELD[silhouette]:
        inside = eased(np.clip(depth / np.float32(RIM), 0, 1))
        share = 1 - np.float32(held) * (1 - inside)
        result = 1 + share * (factors - 1)
    if np.any(np.less(edge, 0)):
        drawn = np.clip((1 - factors) / np.float32(_STRONGEST), -1, 1)
        removed = -np.minimum(edge, 0) * (1 + drawn)
        # Over a cell: a leap would be stairs.
        left = eased(np.clip(depth - removed + 0.5, 0, 1))
        result = np.where(np.less(edge, 0), result * left, result)
    return result.astype(np.float32, copy=False)


def of_mass(density: Field, before: Field) -> FloatArray:
    """The values of a density with as much of it in all as there was before."""
    now, was = (float(field.values.sum(dtype=np.float64)) for field in (density, before))
    if now <= 0 or now == was:
        return density.values
    return density.values * np.float32(was / now)
