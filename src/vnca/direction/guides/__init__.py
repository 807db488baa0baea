"""Guides: directions along which strokes run, as values whose answers are vectors.

A guide answers with `[n, 3]` directions along the axes of the smoke's cells, one long or, where
there is none, zero. Strokes have no sign, but guides do: turned round, they give the same strokes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import GridError
from vnca.core.field import Field
from vnca.direction.mixing import Answer
from vnca.direction.moment import Moment, between
from vnca.direction.values import Value

REACH = 2
"""Cells of the smoke over which it is told how it changes: strokes cannot follow what is finer."""
_NONE = 1e-12
_BESIDE = 0.05
"""Where the surface says less about the frame, the least rotation does."""
_STEEP = 0.1
"""Of the steepest change of density, what counts as a surface."""


def steering(
    directions: AnyArray | None,
    inwards: AnyArray | None,
    size: Answer,
    count: int,
    standing: bool = False,
) -> FloatArray:
    """What cells are steered by, `[n, 3, 3]`, so that strokes run along directions.

    A rule has a frame as its picture has: x to the right, y into the smoke, z up. It is turned so
    that x, or z where strokes stand, lies along the direction and y as nearly inwards as that
    leaves it: a surface that the direction runs along shows the picture turned, and nothing else.
    Where a direction goes straight inwards, the rest is as the least rotation has it.

    Args:
        directions: `[n, 3]`, one long; where zero, nothing is turned. None turns none.
        inwards: `[n, 3]` into the smoke, at most one long.
        size: How many times as large the pattern is to be.
        count: Of cells.
        standing: Whether strokes of the picture are upright, see `picture.strokes_stand`.
    """
    turned = np.broadcast_to(np.eye(3), (count, 3, 3))
    if directions is not None and inwards is not None:
        turned = _frames(directions.astype(np.float64), inwards.astype(np.float64), standing)
    each = np.broadcast_to(np.float64(size), count)[:, None, None]
    return np.ascontiguousarray(each * turned, np.float32)


def _frames(along: AnyArray, inwards: AnyArray, standing: bool) -> AnyArray:
    """Rotations `[n, 3, 3]` that take `along` to x, or z, and what they can of `inwards` to y."""
    # What the least rotation of x to `along` makes of y; of x turned round, y stays.
    x, y, _ = along.T
    first, other = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    least = other - (y / np.maximum(1 + x, _NONE))[:, None] * (along + first)
    second = inwards - (inwards * along).sum(1, keepdims=True) * along + _BESIDE * least
    second /= np.maximum(np.linalg.norm(second, axis=1, keepdims=True), _NONE)
    third = np.cross(along, second)
    found = np.stack([-third, second, along] if standing else [along, second, third], axis=1)
    found[~along.any(axis=1)] = np.eye(3)
    return found


def unit(vectors: AnyArray) -> FloatArray:
    """Vectors `[n, 3]` one long; those that are as good as zero are zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return (vectors / np.where(lengths > _NONE, lengths, np.inf)).astype(np.float32)


@dataclass(frozen=True)
class Axis(Value):
    """A direction of the world of the smoke's files, the same everywhere."""

    x: float
    y: float
    z: float

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        direction = moment.in_cells(np.array([[self.x, self.y, self.z]]))
        return np.broadcast_to(unit(direction), (len(places), 3))


@dataclass(frozen=True)
class Natural(Value):
    """A direction that the smoke has of itself, by one of the names in `NATURAL`."""

    name: str

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        return unit(NATURAL[self.name](moment, places))


@dataclass(frozen=True)
class Across(Value):
    """Across two directions at once."""

    first: Value
    second: Value

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        return unit(np.cross(self.first.at(moment, places), self.second.at(moment, places)))


def _velocity(moment: Moment, places: AnyArray) -> AnyArray:
    return between(_velocity_of(moment), places)


def _curl(moment: Moment, places: AnyArray) -> AnyArray:
    """The axis about which the smoke turns: ∇ × u."""
    x, y, z = (_slope(_velocity_of(moment), places, axis, moment.fineness) for axis in range(3))
    return np.stack([y[:, 2] - z[:, 1], z[:, 0] - x[:, 2], x[:, 1] - y[:, 0]], axis=1)


def _gradient(moment: Moment, places: AnyArray) -> AnyArray:
    density = moment.smoke.density_field
    slopes = (_slope(density, places, axis, moment.fineness) for axis in range(3))
    return np.stack([*slopes], axis=1)


def inwards(moment: Moment, places: AnyArray) -> FloatArray:
    """Directions `[n, 3]` into the smoke, one long at its surface and shorter in it."""
    slopes = _gradient(moment, places)
    lengths = np.linalg.norm(slopes, axis=1, keepdims=True)
    steep = max(_STEEP * float(lengths.max(initial=0)), _NONE)
    return (slopes / np.maximum(lengths, steep)).astype(np.float32)


def _velocity_of(moment: Moment) -> Field:
    velocity = moment.smoke.velocity_field
    if velocity is None:
        raise GridError(f"frame {moment.frame}: `guide`: the smoke has no velocity to follow")
    return velocity


def _slope(field: Field, places: AnyArray, axis: int, fineness: int) -> AnyArray:
    """How values change along an axis; a velocity that is not known beside a place is as there."""
    step = np.zeros(3, places.dtype)
    step[axis] = REACH * fineness
    here, *sides = (between(field, places + side) for side in (0 * step, step, -step))
    if here.ndim > 1:
        sides = [np.where(side.any(axis=1, keepdims=True), side, here) for side in sides]
    return sides[0] - sides[1]


NATURAL: Mapping[str, Callable[[Moment, AnyArray], AnyArray]] = {
    "velocity": _velocity,
    "curl": _curl,
    "gradient": _gradient,
}
