"""One frame, as values ask about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.bricks import EDGE, bricks_beside
from vnca.core.camera import world_box
from vnca.core.field import Field
from vnca.core.volume import Volume
from vnca.direction.distance import distances
from vnca.direction.mixing import mixed
from vnca.io.smoke_format import UpAxis

if TYPE_CHECKING:
    from vnca.direction.carried import Carried

DEEPEST, HIGHEST = 16, 6
"""Cells of the smoke up to which depth below its surface is counted, and height above it."""
# Of the world with y up, where each axis of the file is among ours.
_FILE_AXES = {"z": [0, 1, 2], "y": [1, 2, 0]}
Missing = Literal["stop", "zero", "hold"]
"""Where a frame lacks a grid that is asked for, or has it without a value: an error, zero, or what
the frame before had."""
Paths: TypeAlias = Mapping[int | None, Path]
"""The file of each frame, by its number; one that holds for all under None."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """What there is beside the smoke that is painted.

    Attributes:
        paths: The file of each frame, by its number; none of smoke in memory.
        up: Which axis of the files' world points up.
        missing: What holds where a frame lacks a grid.
        kept: What was read from files and holds for more than a frame.
    """

    paths: Paths = field(default_factory=dict)
    up: UpAxis = "z"
    missing: Missing = "stop"
    kept: dict[Any, Any] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame that values are asked about.

    Attributes:
        smoke: The frame, on the grid of the automaton.
        box: Holds the smoke of all frames, in its cells.
        threshold: The density from which a cell counts as smoke.
        fineness: How many of its cells lie along an edge of a cell of the smoke as it was read.
        inputs: What else there is.
        carried: What went along with the smoke to this frame.
    """

    smoke: Volume
    box: Box
    threshold: float = 0.0
    fineness: int = 1
    inputs: Inputs = field(default_factory=Inputs)
    carried: "Carried | None" = None

    @property
    def frame(self) -> int:
        """Its number."""
        return self.smoke.frame

    @cached_property
    def bounds(self) -> tuple[AnyArray, AnyArray]:
        """The least and greatest corner, in our world, of the box of the smoke of all frames."""
        lower, upper = (np.asarray(corner) - 0.5 for corner in self.box)
        return world_box(lower, upper, self.smoke.index_to_world)

    def world(self, places: AnyArray) -> AnyArray:
        """Points `[n, 3]` of our world, float64, at places in index coordinates of the smoke."""
        matrix = self.smoke.index_to_world
        return places @ matrix[:3, :3].T + matrix[:3, 3]

    def in_file(self, points: AnyArray) -> AnyArray:
        """Points of our world in the world of the file."""
        return points[..., _FILE_AXES[self.inputs.up]]

    def in_cells(self, directions: AnyArray) -> AnyArray:
        """Directions `[n, 3]` of the world of the file along the axes of the smoke's cells."""
        ours = np.empty_like(directions)
        ours[..., _FILE_AXES[self.inputs.up]] = directions
        return ours @ np.linalg.inv(self.smoke.index_to_world[:3, :3]).T

    @property
    def is_smoke(self) -> Field:
        """The cells that count as smoke."""
        density = self.smoke.density_field
        return replace(density, values=density.values > self.threshold, outside=False)

    @cached_property
    def speed(self) -> Field:
        """Cells of the smoke, as it was read, per frame."""
        velocity = self.smoke.velocity_field
        if velocity is None:
            density = self.smoke.density_field
            return replace(density, values=np.zeros_like(density.values))
        length = np.linalg.norm(velocity.values, axis=-1) / np.float32(self.fineness)
        return replace(velocity, values=length, outside=np.float32(0))

    @cached_property
    def depth(self) -> Field:
        """How far a cell lies below the surface of the smoke, in its cells as they were read."""
        smoke = self.is_smoke
        inside = np.where(smoke.values, np.float32(np.inf), np.float32(0))
        found = distances(
            replace(smoke, values=inside, outside=np.float32(0)), DEEPEST * self.fineness
        )
        # The surface lies between the last cell of smoke and the first without.
        below = np.maximum(found.values - np.float32(0.5), 0) / np.float32(self.fineness)
        return replace(found, values=below, outside=np.float32(0))

    @cached_property
    def signed_depth(self) -> Field:
        """The same, below zero outside of the smoke, down to `HIGHEST` cells from it."""
        inside, smoke, most = self.depth, self.is_smoke, (HIGHEST + 1) * self.fineness
        bricks = bricks_beside(smoke.bricks, -(-most // EDGE))
        away = np.where(smoke.blocks(bricks), np.float32(0), np.float32(np.inf))
        wide = replace(smoke, bricks=bricks, values=away, outside=np.float32(np.inf))
        above = np.maximum(distances(wide, most).values - np.float32(0.5), 0)
        values = inside.blocks(bricks) - above / np.float32(self.fineness)
        return replace(wide, values=values, outside=np.float32(-HIGHEST - 1))

    def sampled(self, field: Field, places: AnyArray) -> FloatArray:
        """Values `[n]` of a field of the smoke's cells, at cells or straight in between."""
        return between(field, places)


def between(field: Field, places: AnyArray) -> Any:
    """Values `[n, ...]` of a field at places `[n, 3]`, straight between centres; equals exactly."""
    if places.dtype.kind == "i":
        return field.gather(places)
    first = np.floor(places).astype(np.int32)
    part = (places - first).astype(np.float32)
    part = part.reshape(*part.shape, *[1] * (field.values.ndim - 4))
    corners = [field.gather(first + np.array(c, np.int32)) for c in product((0, 1), repeat=3)]
    for axis in (2, 1, 0):
        # Of neighbours in the list, the second is farther along the last axis that is left.
        corners = [
            mixed(low, high, part[:, axis])
            for low, high in zip(corners[::2], corners[1::2], strict=True)
        ]
    return corners[0]
