"""What the other methods see of smoke: their renderer, and from where.

Reference: Kim et al. 2019 (TNST): I = Σ d_k exp(−γ Σ_{j≤k} d_j), orthographic, a sample a cell,
divided by the brightest pixel.
"""

import math
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from vnca.core.camera import view_axes
from vnca.peers.transport import places, sample

FRONT = (0.0, 0.0)
_LEAST = 1e-6


class Frustum(NamedTuple):
    """Cells that are looked at, across, deep and high."""

    columns: int
    depth: int
    rows: int

    @classmethod
    def front(cls, shape: tuple[int, ...] | torch.Size) -> "Frustum":
        """As large as a box is, seen from the front."""
        x, y, z = shape[:3]
        return cls(x, y, z)

    @classmethod
    def around(cls, shape: tuple[int, ...] | torch.Size) -> "Frustum":
        """As large as a box is from any side, level."""
        x, y, z = shape[:3]
        across = math.ceil(math.hypot(x, y))
        return cls(across, across, z)


def brightness(
    density: Float[Tensor, "x y z"],
    azimuth: float,
    elevation: float,
    gamma: float,
    frustum: Frustum | None = None,
    *,
    sheared: bool = False,
) -> Float[Tensor, "rows columns"]:
    """Smoke as it glows, absorbing its own light; not divided by the brightest yet.

    Angles are those of `vnca.core.camera`. Turned smoke is resampled in cells, so that it keeps its
    shape in a box that is no cube.

    Args:
        density: Non-negative.
        azimuth: Degrees.
        elevation: Degrees.
        gamma: Extinction of density 1, 1/cell.
        frustum: How much is seen; the box from the front unless given.
        sheared: Turn coordinates from −1 to 1 along every side of the box, as the published code of
            TNST and LNST does by a slip.
    """
    frustum = frustum or Frustum.front(density.shape)
    if (azimuth, elevation) != FRONT or frustum != Frustum.front(density.shape):
        density = _turned(density, azimuth, elevation, frustum, sheared=sheared)
    light = density * torch.exp(-gamma * density.cumsum(1))
    return light.sum(1).T.flip(0)


def _turned(
    density: Tensor, azimuth: float, elevation: float, frustum: Frustum, *, sheared: bool
) -> Tensor:
    right, up, forward = (density.new_tensor(axis) for axis in view_axes(azimuth, elevation))
    shape = (frustum.columns, frustum.depth, frustum.rows)
    offset = places(shape, density) - (density.new_tensor(shape) - 1) / 2
    half = density.new_tensor(density.shape) / 2 if sheared else density.new_ones(3)
    turned = (offset / half) @ torch.stack([right, forward, up]) * half
    at = turned + (density.new_tensor(density.shape) - 1) / 2
    return sample(density, at, outside="zeros")


def pictures(
    density: Float[Tensor, "x y z"],
    views: list[tuple[float, float]],
    gamma: float,
    frustum: Frustum | None = None,
    *,
    sheared: bool = False,
) -> Float[Tensor, "b 1 rows columns"]:
    """Views of smoke, the brightest pixel of them all being 1."""
    looks = [brightness(density, *view, gamma, frustum, sheared=sheared) for view in views]
    seen = torch.stack(looks)[:, None]
    return seen / seen.amax().clamp_min(_LEAST)


def drawn_views(
    count: int,
    random: np.random.Generator,
    *,
    widest: tuple[float, float] = (10.0, 5.0),
    published: bool = False,
) -> list[tuple[float, float]]:
    """Azimuths and elevations that keep their distance from each other, the front among them.

    Poisson-disc samples, by throwing darts; where no more find room, the rest is drawn freely.

    Args:
        count: How many.
        random: Where they are drawn from.
        widest: Degrees to either side, and up and down.
        published: In the place of the front, half of the range, as the published code of TNST has
            it by a slip.
    """
    found = [(widest[0], widest[1]) if published else FRONT]
    apart = max(widest) / 2
    for attempt in range(100 * count):
        if len(found) == count:
            break
        azimuth, elevation = random.uniform(-1, 1, 2) * widest
        near = min(math.hypot(azimuth - a, elevation - e) for a, e in found)
        if near >= apart or attempt >= 50 * count:
            found.append((float(azimuth), float(elevation)))
    return found[:count]
