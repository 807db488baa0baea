"""Planes through a block, and what they show.

A slice is what an orthographic camera would see of a single plane: its target is the middle, its
angles are the slice's, and up in the picture is up in the block as far as the angle allows. A
pattern that has an up in the picture keeps it.
"""

import math
from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.core.camera import Orthographic, view_axes
from vnca.rendering.colour import linear_to_srgb
from vnca.rendering.sample import sample

Angles = tuple[float, float]
"""Azimuth and elevation, degrees."""

DIAGONAL = math.degrees(math.asin(math.sqrt(1 / 3)))
"""Elevation of a view along a diagonal of the block."""
UNSEEN = 15.0
"""Degrees around the block's diagonals that training keeps out of: what a rule shows there, it
was not taught."""


def axis_angles(random: np.random.Generator) -> Angles:
    """A plane along two axes of the block: from one of four sides, or from above or below."""
    elevation = random.choice([-90.0, 0.0, 0.0, 0.0, 0.0, 90.0])
    return 90.0 * int(random.integers(4)), float(elevation)


def oblique_angles(random: np.random.Generator) -> Angles:
    """A plane at any angle, uniform over the sphere, but those of `unseen_angles`."""
    while True:
        azimuth = random.uniform(0, 360)
        elevation = math.degrees(math.asin(random.uniform(-1, 1)))
        if not is_unseen(azimuth, elevation):
            return azimuth, elevation


def unseen_angles(random: np.random.Generator) -> Angles:
    """A plane across a diagonal of the block, within a few degrees."""
    while True:
        azimuth = 45.0 + 90.0 * int(random.integers(4)) + random.uniform(-UNSEEN, UNSEEN)
        elevation = random.choice([-1, 1]) * (DIAGONAL + random.uniform(-UNSEEN, UNSEEN))
        if is_unseen(azimuth, elevation):
            return azimuth, elevation


FAMILIES: dict[str, Callable[[np.random.Generator], Angles]] = {
    "axis": axis_angles,
    "oblique": oblique_angles,
    "unseen": unseen_angles,
}
"""Slices by what training knows of them: the first two kinds it draws, the third never."""


def is_unseen(azimuth: float, elevation: float) -> bool:
    """Whether a plane's normal is near a diagonal of the block."""
    normal = np.abs(view_axes(azimuth, elevation)[2])
    return bool(normal.sum() / math.sqrt(3) > math.cos(math.radians(UNSEEN)))


def slice_points(
    angles: Angles, middle: np.ndarray, *, size: int, spacing: float = 1.0
) -> Float[Tensor, "r c 3"]:
    """Cell coordinates of the pixels of a slice."""
    x, y, z = (float(value) for value in middle)
    plane = Orthographic((x, y, z), *angles, height=size * spacing)
    return torch.from_numpy(plane.rays(size, size)[0].astype(np.float32))


def periodic(block: Float[Tensor, "x y z c"]) -> Float[Tensor, "_ _ _ c"]:
    """A block with its first cells repeated behind the last, to be read up to its border."""
    padded = functional.pad(block.permute(3, 0, 1, 2)[None], (0, 1) * 3, mode="circular")
    return padded[0].permute(1, 2, 3, 0)


def shown(
    block: Float[Tensor, "x y z 3"], points: Float[Tensor, "*pixels 3"]
) -> Float[Tensor, "*pixels 3"]:
    """Colours of a block that tiles space at points in cells, trilinear; differentiable."""
    size = points.new_tensor(block.shape[:3])
    return sample(periodic(block), torch.remainder(points, size).view(-1, 3)).view(points.shape)


def averaged(samples: Float[Tensor, "_ _ c"], along: int) -> Float[Tensor, "_ _ c"]:
    """Pixels of which each is the mean of `along` × `along` samples; differentiable."""
    if along == 1:
        return samples
    rows, columns, channels = samples.shape
    return samples.view(rows // along, along, columns // along, along, channels).mean((1, 3))


def as_picture(colour: Float[Tensor, "r c 3"]) -> Float[Tensor, "1 3 r c"]:
    """Linear RGB as the appearance loss wants it: sRGB, channels first."""
    return linear_to_srgb(colour).permute(2, 0, 1)[None]
