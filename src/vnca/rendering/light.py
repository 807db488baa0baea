"""A key light and a sky that shine through smoke, and the shadows that it throws on itself.

How much light reaches a cell is found once for all cells, in numpy, so that a view looks it up at
its samples: README.md. Nothing here is differentiated.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import floor, isfinite, log

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import view_axes
from vnca.core.errors import OptionError, ShapeError
from vnca.engine.native.marching import Shade

FINEST = 96
"""Cells of a light volume along the longest side of what is lit: shadows are soft."""

OCTAVES = ((0.8, 1.0), (0.2, 1 / 4))
"""Weights, which add up to one, and parts of the extinction that light meets: when it is scattered
once, and more often. Chosen by what Cycles makes of grey smoke (README.md).

Reference: Wrenninge, Kulla & Lundqvist 2013.
"""

FACING = sum(weight / (1 + part) for weight, part in OCTAVES)
"""How bright opaque smoke is that faces a light of 1 (README.md)."""
EVEN = sum(weight / 2 * (1 - part * log(1 + 1 / part)) for weight, part in OCTAVES)
"""How bright a flat face of opaque smoke is in light of 1 from everywhere (README.md)."""

SKY = tuple(
    (1 / 15 if abs(way).sum() == 1 else 3 / 40, way / np.linalg.norm(way))
    for way in np.array(list(product((-1, 0, 1), repeat=3)))
    if abs(way).sum() in (1, 3)
)
"""Weights, which add up to one, and unit vectors of the world that light from everywhere is summed
along: the sides and the corners of a cube.

Reference: Lebedev 1976.
"""


@dataclass(frozen=True)
class Light:
    """A light from infinitely far away, and light from everywhere.

    Attributes:
        azimuth: Where it stands, degrees: where a camera of that azimuth does (`core/camera.py`).
        elevation: Degrees above the horizon.
        strength: 0 lets the smoke glow by itself; 1 lights it and lets nothing glow, between them
            it does some of both; above 1 the light is so many times as bright.
        ambient: Part of the light that comes from everywhere, 0 to 1.
    """

    azimuth: float
    elevation: float
    strength: float = 1.0
    ambient: float = 0.2

    def __post_init__(self) -> None:
        if not (isfinite(self.azimuth) and isfinite(self.elevation)):
            raise OptionError("light: expected its azimuth and elevation in degrees")
        if not 0 <= self.strength < np.inf:
            raise OptionError(f"light: expected a strength of 0 or more, got {self.strength}")
        if not 0 <= self.ambient <= 1:
            raise OptionError(f"light: expected ambient light from 0 to 1, got {self.ambient}")

    @property
    def towards(self) -> AnyArray:
        """The unit vector towards it."""
        return -view_axes(self.azimuth, self.elevation)[2]

    @property
    def full(self) -> float:
        """What a colour is multiplied by where no smoke is in the way."""
        return max(1.0, self.strength)


class LightVolume:
    """How much light reaches each place in the smoke.

    Attributes:
        shade: What it does to colours, as shadow at the centres of cells that are as coarse as
            asked for.
        shape: Cells of the density.
    """

    def __init__(
        self,
        density: FloatArray,
        light: Light,
        *,
        gamma: float,
        cells_to_world: AnyArray | None = None,
        spacing: float = 0.0,
        origin: Sequence[int] = (0, 0, 0),
    ) -> None:
        """Send the light through the smoke. Deterministic bit for bit.

        Args:
            density: `[x, y, z]`, non-negative.
            light: Where it comes from.
            gamma: Extinction of density one, 1/length.
            cells_to_world: 4×4, affine and invertible, as in `view.render`; lengths are those of
                the space it leads to, in which the light stands.
            spacing: Length over which density is averaged, about: whole cells, at least one.
            origin: Number of the first cell. What is averaged together stays together where the
                cells of a later frame begin elsewhere, or shadows would tremble.

        Raises:
            OptionError: If an option is out of range.
        """
        if not gamma >= 0:
            raise OptionError(f"gamma: expected 0 or more, got {gamma}")
        self.shape = density.shape
        matrix = np.eye(3) if cells_to_world is None else cells_to_world[:3, :3]
        edges = np.linalg.norm(matrix, axis=0)
        times = np.maximum(np.rint(spacing / edges), 1).astype(int)
        before = times + np.asarray(origin) % times
        extinction = _averaged(density, times.tolist(), before.tolist()) * np.float32(gamma)
        in_cells = np.linalg.inv(matrix * times)
        shadow = np.zeros(extinction.shape, np.float32)
        for part, facing, ways in (
            (1 - light.ambient, FACING, ((1.0, light.towards),)),
            (light.ambient, EVEN, SKY),
        ):
            if part * light.strength > 0:
                reached = sum(
                    np.float32(weight) * _passed(_swept(extinction, in_cells @ way))
                    for weight, way in ways
                )
                shadow += np.float32(part * light.strength) * np.maximum(
                    1 - reached / np.float32(facing), 0
                )
        self.shade = Shade(
            shadow,
            tuple((before - (times - 1) / 2).tolist()),
            tuple(times.astype(float).tolist()),
            light.full,
        )

    def check(self, shape: Sequence[int]) -> None:
        """Raise `ShapeError` unless it is the light of smoke with as many cells."""
        if tuple(shape) != self.shape:
            raise ShapeError(
                f"light: expected that of smoke of {tuple(shape)} cells, got {self.shape}"
            )


def spacing_for(lower: AnyArray, upper: AnyArray) -> float:
    """The spacing at which a box has `FINEST` cells along its longest side."""
    return float(np.max(np.asarray(upper) - np.asarray(lower))) / FINEST


def _averaged(density: FloatArray, times: Sequence[int], before: Sequence[int]) -> FloatArray:
    """Means over blocks, with a block or more of nothing around the smoke."""
    means = density
    for axis, (block, first) in enumerate(zip(times, before, strict=True)):
        means = np.moveaxis(means, axis, 0)
        last = block + -(len(means) + first) % block
        padded = np.zeros((first + len(means) + last, *means.shape[1:]), np.float32)
        padded[first : first + len(means)] = means
        # A layer at a time is quicker than the mean along an axis of blocks.
        total = padded[::block].copy()
        for layer in range(1, block):
            total += padded[layer::block]
        means = np.moveaxis(total / np.float32(block), 0, axis)
    return means


def _passed(depth: FloatArray) -> FloatArray:
    """How much of a light of 1 gets through smoke, scattered once or more often."""
    passed = np.zeros_like(depth)
    for weight, part in OCTAVES:
        passed += np.float32(weight) * np.exp(np.float32(-part) * depth)
    return passed


def _swept(extinction: FloatArray, towards: AnyArray) -> FloatArray:
    """Optical depth from each cell to where the light enters.

    Layer by layer away from the light: what lies before a cell is interpolated in the layer
    before it. That blurs shadows more the further they fall.

    Args:
        extinction: `[x, y, z]`, 1/length.
        towards: Cells passed in a length towards the light.
    """
    main = int(np.abs(towards).argmax())
    others = [axis for axis in range(3) if axis != main]
    layers = np.moveaxis(extinction, main, 0)
    if towards[main] > 0:
        layers = layers[::-1]
    layers = np.ascontiguousarray(layers)
    half = 0.5 / abs(float(towards[main]))
    shift = [float(towards[axis] / abs(towards[main])) for axis in others]
    depth = np.zeros_like(layers)
    for k in range(1, len(layers)):
        reached = depth[k - 1] + half * layers[k - 1]
        depth[k] = _shifted(reached, *shift) + half * layers[k]
    if towards[main] > 0:
        depth = depth[::-1]
    return np.ascontiguousarray(np.moveaxis(depth, 0, main))


def _shifted(layer: FloatArray, down: float, right: float) -> FloatArray:
    """Values at `[i + down, j + right]`, interpolated; zero outside; shifts within ±1."""
    rows, columns = layer.shape
    padded = np.pad(layer, 2)
    i, j = floor(down), floor(right)
    a, b = np.float32(down - i), np.float32(right - j)
    top = padded[2 + i : 2 + i + rows]
    bottom = padded[3 + i : 3 + i + rows]
    mixed = (1 - a) * top + a * bottom
    return (1 - b) * mixed[:, 2 + j : 2 + j + columns] + b * mixed[:, 3 + j : 3 + j + columns]
