"""Shapes as values: 1 inside, 0 outside, and in between where an edge is soft."""

from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.direction.mixing import Answer, eased
from vnca.direction.moment import Moment
from vnca.direction.values import Constant, Value

HARD = Constant(0.0)


def edge(distance: AnyArray, soft: Answer) -> FloatArray:
    """What a shape holds at distances from it, `[n]`: 1 up to 0, falling to 0 over `soft`."""
    width = np.maximum(soft, np.finfo(np.float32).tiny)
    beyond = np.clip(distance / width, 0, 1)
    return (1 - eased(beyond)).astype(np.float32)


@dataclass(frozen=True)
class Cuboid(Value):
    """A box along the axes of the file's world, between two corners."""

    x: Value
    y: Value
    z: Value
    to_x: Value
    to_y: Value
    to_z: Value
    soft: Value = HARD

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        points = moment.in_file(moment.world(places))
        beyond = []
        for axis, (one, other) in enumerate(
            ((self.x, self.to_x), (self.y, self.to_y), (self.z, self.to_z))
        ):
            a, b = one.at(moment, places), other.at(moment, places)
            along = points[:, axis]
            beyond.append(np.maximum(np.minimum(a, b) - along, along - np.maximum(a, b)))
        distance = np.linalg.norm(np.maximum(beyond, 0), axis=0)
        return edge(distance, self.soft.at(moment, places))


@dataclass(frozen=True)
class Ball(Value):
    """A sphere in the file's world."""

    x: Value
    y: Value
    z: Value
    radius: Value
    soft: Value = HARD

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        points = moment.in_file(moment.world(places))
        centre = (self.x, self.y, self.z)
        away = [points[:, axis] - one.at(moment, places) for axis, one in enumerate(centre)]
        distance = np.linalg.norm(away, axis=0) - self.radius.at(moment, places)
        return edge(distance, self.soft.at(moment, places))
