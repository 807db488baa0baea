"""How far a painting may change the outline of the smoke, and its mass."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.bricks import CELLS, EDGE, bricks_beside, cells_at
from vnca.core.field import Field
from vnca.direction.mixing import Answer, eased
from vnca.direction.moment import HIGHEST, Moment, between

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


def fluffed(
    density: Field,
    colour: Field,
    factors: Field,
    places: Callable[[AnyArray], AnyArray],
    moment: Moment,
    edge: Callable[[AnyArray], Answer],
) -> tuple[Field, Field]:
    """A density whose outline is moved outwards, and its colour.

    Twice as far where the painting thickens the smoke, not at all where it thins it. What a place
    holds then lay as far inside along the way to the surface; only places less than a cell below it
    are changed.

    Args:
        density: Of the painting.
        colour: Of the painting, in the same box.
        factors: What it was multiplied by.
        places: Where cells of it lie in index coordinates of the moment's smoke.
        moment: The frame.
        edge: By how many cells of the smoke the outline is moved at such places.
    """
    signed = moment.signed_depth
    scale = float(np.linalg.norm(places(np.eye(3)[:1]) - places(np.zeros((1, 3)))))
    bricks = bricks_beside(density.bricks, math.ceil(HIGHEST * moment.fineness / scale / EDGE))
    density, colour = (
        replace(field, bricks=bricks, values=field.blocks(bricks)) for field in (density, colour)
    )
    cells = cells_at(bricks, np.ones((len(bricks), EDGE, EDGE, EDGE), bool))
    box = density.box
    cells = cells[((cells >= box.lower) & (cells < box.upper)).all(axis=1)]
    depth = between(signed, places(cells))
    cells = cells[(depth < 1) & (depth > -HIGHEST)]
    at = places(cells)
    thick = np.clip((factors.gather(cells) - 1) / np.float32(_STRONGEST), -1, 1)
    moved = np.maximum(edge(at), 0) * (1 + thick)
    origin = cells + (moved[:, None] * _slope(signed, at) * (moment.fineness / scale))
    values = between(density, origin)
    more = values > density.gather(cells)
    cells, values, origin = cells[more], values[more], origin[more]
    shown = between(colour, origin)
    density.values.reshape(-1)[density.find(cells)] = values
    colour.values.reshape(-1, 3)[colour.find(cells)] = shown
    return density.trimmed(), colour


def _slope(field: Field, at: AnyArray) -> AnyArray:
    """Unit vectors `[n, 3]` along which a field grows fastest; zero where it is even."""
    steps = 0.5 * np.eye(3)
    slopes = [between(field, at + step) - between(field, at - step) for step in steps]
    slope = np.stack(slopes, axis=-1)
    length = np.linalg.norm(slope, axis=-1, keepdims=True)
    return slope / np.where(length > 0, length, 1)


def masses(density: Field) -> AnyArray:
    """How much smoke there is in each brick, `[m]`, float64."""
    values = density.values.reshape(len(density.bricks), CELLS)
    return values.astype(np.float64).sum(axis=1)


def total(masses: AnyArray) -> float:
    """The sum of some masses, the same in whatever order they come."""
    return math.fsum(masses.tolist())


def of_mass(density: Field, now: float, was: float) -> FloatArray:
    """The values of a density with as much of it in all as there was before.

    Args:
        density: The density.
        now: How much there is, in all of its frame.
        was: How much there was.
    """
    if now <= 0 or now == was:
        return density.values
    return density.values * np.float32(was / now)
