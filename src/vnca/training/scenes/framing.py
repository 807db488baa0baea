"""Where smoke is looked at from in training."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.camera import Camera, Orthographic, turntable, world_box

_UPRIGHT = 1e-6
"""Cells turned and stretched by less than this are upright cubes."""


class SmokeViewpoint(NamedTuple):
    """Where smoke is looked at from, and how.

    Attributes:
        camera: The camera.
        offset: Shift of all samples along their rays, in steps.
        thinness: What gamma is multiplied by: below 1, smoke is more translucent.
    """

    camera: Camera
    offset: float
    thinness: float = 1.0


def view_width(box: Box, index_to_world: AnyArray) -> float:
    """Cells across a view of training, the same from all sides: patterns keep their size."""
    lower, upper = (np.asarray(corner) for corner in box)
    return level_turntable(*around(lower, upper, stood(index_to_world))).height


def stood(index_to_world: AnyArray) -> AnyArray | None:
    """4×4, how cells stand in the world and what shape they have there, in lengths of a cell.

    None for upright cubes, which need not be turned.
    """
    linear = index_to_world[:3, :3] / np.cbrt(abs(np.linalg.det(index_to_world[:3, :3])))
    if np.allclose(linear, np.eye(3), rtol=0, atol=_UPRIGHT):
        return None
    place = np.eye(4)
    place[:3, :3] = linear
    return place


def around(
    lower: AnyArray, upper: AnyArray, place: AnyArray | None
) -> tuple[list[float], list[float]]:
    """The box around cells, where cameras are."""
    if place is not None:
        lower, upper = world_box(lower, upper, place)
    return lower.tolist(), upper.tolist()


def level_turntable(
    lower: Sequence[float], upper: Sequence[float], azimuth: float = 0.0, elevation: float = 0.0
) -> Orthographic:
    """As near as level views allow: those from above or below may cut off corners of the box."""
    return turntable(lower, upper, azimuth, elevation, steepest=0)
