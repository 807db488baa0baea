"""A key light that shines through smoke, and the shadows that the smoke throws on itself.

How much smoke lies between a cell and the light is found once for all cells, so that a view looks
it up at its samples: README.md. Nothing here is differentiated.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, isfinite

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.core import AnyArray
from vnca.core.camera import view_axes
from vnca.core.errors import OptionError, ShapeError
from vnca.rendering.march import sample

FINEST = 96
"""Cells of a light volume along the longest side of what is lit: shadows are soft."""

OCTAVES = ((0.5, 1.0), (0.3, 1 / 4), (0.2, 1 / 16))
"""Weights, which add up to one, and parts of the extinction that light scattered ever more often
meets."""

_FACING = sum(weight / (1 + part) for weight, part in OCTAVES)


@dataclass(frozen=True)
class Light:
    """A light from infinitely far away, and light from everywhere.

    Attributes:
        azimuth: Where it stands, degrees: where a camera of that azimuth does (`core/camera.py`).
        elevation: Degrees above the horizon.
        strength: 0 lets the smoke glow by itself; 1 lights it and lets nothing glow, between them
            it does some of both; above 1 the light is so many times as bright.
        ambient: Part of the light that comes from everywhere and reaches every cell, 0 to 1.
    """

    azimuth: float
    elevation: float
    strength: float = 1.0
    ambient: float = 0.15

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

    def factor(self, depth: Tensor) -> Tensor:
        """What a colour is multiplied by behind so much smoke, an optical depth of any shape.

        1 in front of all smoke, at a strength of at most 1; never more than at an optical depth
        of 0.

        Reference: Wrenninge, Kulla & Lundqvist 2013: light scattered many times as a sum over
        octaves, each of them weaker and less absorbed.
        """
        direct = torch.zeros_like(depth)
        for weight, part in OCTAVES:
            direct += weight * torch.exp(-part * depth)
        direct = (direct / _FACING).clamp_max(1)
        glow = max(1 - self.strength, 0.0)
        return glow + self.strength * (self.ambient + (1 - self.ambient) * direct)


class LightVolume:
    """The optical depth of the smoke between each place and the light.

    Attributes:
        depth: `[x, y, z]`, optical depths at the centres of cells that are as coarse as asked for.
        shape: Cells of the density.
    """

    @torch.no_grad()
    def __init__(
        self,
        density: Float[Tensor, "x y z"],
        light: Light,
        *,
        gamma: float,
        cells_to_world: AnyArray | None = None,
        spacing: float = 0.0,
        origin: Sequence[int] = (0, 0, 0),
    ) -> None:
        """Send the light through the smoke. Deterministic bit for bit on the CPU.

        Args:
            density: Non-negative.
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
        self.light, self.shape = light, density.shape
        matrix = np.eye(3) if cells_to_world is None else cells_to_world[:3, :3]
        edges = np.linalg.norm(matrix, axis=0)
        times = np.maximum(np.rint(spacing / edges), 1).astype(int)
        before = times + np.asarray(origin) % times
        coarse = _averaged(density, times.tolist(), before.tolist())
        towards = np.linalg.inv(matrix * times) @ light.towards
        self.depth = _swept(coarse * gamma, towards)
        self._first = density.new_tensor(before - (times - 1) / 2)
        self._times = density.new_tensor(times)

    def at(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
        """What colours at points, in cells of the density, are multiplied by."""
        where = (points + self._first) / self._times
        return self.light.factor(sample(self.depth[..., None], where)[:, 0])

    def check(self, density: Tensor) -> None:
        """Raise `ShapeError` unless it is the light of smoke with as many cells."""
        if density.shape != self.shape:
            raise ShapeError(
                f"light: expected that of smoke of {tuple(density.shape)} cells, "
                f"got {tuple(self.shape)}"
            )


def spacing_for(lower: AnyArray, upper: AnyArray) -> float:
    """The spacing at which a box has `FINEST` cells along its longest side."""
    return float(np.max(np.asarray(upper) - np.asarray(lower))) / FINEST


def _averaged(density: Tensor, times: Sequence[int], before: Sequence[int]) -> Tensor:
    """Means over blocks, with a block or more of nothing around the smoke."""
    sides: list[int] = []
    for size, block, first in zip(density.shape, times, before, strict=True):
        last = block + -(size + first) % block
        sides = [first, last, *sides]  # torch pads the last axis first
    padded = functional.pad(density, sides)
    if max(times) == 1:
        return padded
    return functional.avg_pool3d(padded[None, None], tuple(times))[0, 0]


def _swept(extinction: Tensor, towards: AnyArray) -> Tensor:
    """Optical depth from each cell to where the light enters.

    Layer by layer away from the light: what lies before a cell is interpolated in the layer
    before it. That blurs shadows more the further they fall.

    Args:
        extinction: `[x, y, z]`, 1/length.
        towards: Cells passed in a length towards the light.
    """
    main = int(np.abs(towards).argmax())
    others = [axis for axis in range(3) if axis != main]
    layers = extinction.movedim(main, 0)
    if towards[main] > 0:
        layers = layers.flip(0)
    half = 0.5 / abs(float(towards[main]))
    shift = [float(towards[axis] / abs(towards[main])) for axis in others]
    depth = torch.zeros_like(layers)
    for k in range(1, len(layers)):
        reached = depth[k - 1] + half * layers[k - 1]
        depth[k] = _shifted(reached, *shift) + half * layers[k]
    if towards[main] > 0:
        depth = depth.flip(0)
    return depth.movedim(0, main).contiguous()


def _shifted(layer: Tensor, down: float, right: float) -> Tensor:
    """Values at `[i + down, j + right]`, interpolated; zero outside; shifts within ±1."""
    rows, columns = layer.shape
    padded = functional.pad(layer, (2, 2, 2, 2))
    i, j = floor(down), floor(right)
    a, b = down - i, right - j
    top = padded[2 + i : 2 + i + rows]
    bottom = padded[3 + i : 3 + i + rows]
    mixed = (1 - a) * top + a * bottom
    return (1 - b) * mixed[:, 2 + j : 2 + j + columns] + b * mixed[:, 3 + j : 3 + j + columns]
