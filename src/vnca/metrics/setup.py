"""Where the smoke of a sequence is looked at, and what is seen of it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from scipy.ndimage import gaussian_filter

from vnca.core import AnyArray, BoolArray, Box, FloatArray, Index
from vnca.core.camera import Orthographic, turntable
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.painting import Painting
from vnca.rendering import rays_along
from vnca.rendering.view import projected_velocity, render
from vnca.rule import SMOKE_THRESHOLD, Rule
from vnca.training.scenes.smoke import smoke_bounds

OPAQUE = 0.8
"""Opacity from which a pixel counts as smoke."""
SIZE = 224
"""Rows and columns of pictures, unless told otherwise."""
STEP = 0.5
"""Distance between samples along a ray, cells."""
_GREY = 0.214  # linear, of sRGB ½: what a state of zeros shows
_LIGHT = np.array([-0.48, -0.36, 0.8], np.float32)  # towards it


class Viewpoint(NamedTuple):
    """Where smoke is looked at from, degrees."""

    azimuth: float
    elevation: float


class Coloured(NamedTuple):
    """Smoke with a colour.

    Attributes:
        density: `[x, y, z]`, in the units of the file.
        colour: Linear RGB `[x, y, z, 3]`.
        origin: Index coordinates of the first cell.
    """

    density: FloatArray
    colour: FloatArray
    origin: Index

    @classmethod
    def painted(cls, painting: Painting) -> "Coloured":
        """As a rule paints it."""
        return cls(painting.density, painting.colour, painting.smoke.origin)

    @classmethod
    def plain(cls, smoke: Volume) -> "Coloured":
        """As it comes: grey, lit from above, so that its shape can be seen.

        Mid-grey on average over all directions that a surface can face.
        """
        slopes = np.zeros((*smoke.density.shape, 3), np.float32)
        if min(smoke.density.shape) > 1:
            smooth = gaussian_filter(smoke.density, 1.0)
            slopes = np.stack([np.gradient(smooth, axis=axis) for axis in range(3)], axis=-1)
        steepness = np.linalg.norm(slopes, axis=-1, keepdims=True)
        facing = -(slopes / np.maximum(steepness, 1e-6)) @ _LIGHT
        shade = _GREY * (1 + facing / 2)
        return cls(smoke.density, np.repeat(shade[..., None], 3, axis=-1), smoke.origin)


@dataclass(frozen=True, eq=False)
class Seen:
    """One picture of smoke.

    Attributes:
        colour: Linear RGB `[r, c, 3]`, premultiplied by opacity.
        opacity: `[r, c]`.
        depth: `[r, c]`, of what is seen, cells; infinite where that is nothing.
    """

    colour: FloatArray
    opacity: FloatArray
    depth: FloatArray

    def over(self, background: AnyArray | Sequence[float]) -> FloatArray:
        """The picture in front of a linear RGB colour."""
        behind = (1 - self.opacity)[..., None] * np.asarray(background, np.float32)
        return (self.colour + behind).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Pair:
    """The same smoke seen from the same place, painted and as it comes."""

    viewpoint: Viewpoint
    painted: Seen
    plain: Seen

    @property
    def where(self) -> BoolArray:
        """Where it is opaque, both ways."""
        return (self.painted.opacity > OPAQUE) & (self.plain.opacity > OPAQUE)


@dataclass(frozen=True)
class Setup:
    """How a sequence is looked at.

    Attributes:
        box: Holds the smoke of all frames; pictures are framed on it.
        gamma: Extinction of density 1 in the units of the files, 1/cell.
        size: Rows and columns of the pictures.
    """

    box: Box
    gamma: float
    size: int = SIZE

    @classmethod
    def around(cls, frames: Iterable[Volume], rule: Rule, size: int = SIZE) -> "Setup":
        """Framed on what a rule takes for smoke, as bright as what it was trained on.

        Raises:
            GridError: If there is no smoke in any frame.
        """
        box = Box((0, 0, 0), (0, 0, 0))
        for smoke in frames:
            if (smoke.density > SMOKE_THRESHOLD * rule.scales.density).any():
                box = box.union(smoke_bounds(smoke, rule.scales.density))
        if box.is_empty:
            raise GridError("there is no smoke in any frame; choose others")
        return cls(box, rule.scales.extinction(cell_length=1.0), size)

    def refined(self, factor: int) -> "Setup":
        """The same place on a grid `factor` times as fine along each axis."""
        return replace(self, box=self.box.refined(factor), gamma=self.gamma / factor)

    @property
    def scale(self) -> float:
        """Pixels per cell, the same from all sides."""
        return self.size / self.camera(Viewpoint(0.0, 0.0)).height

    def camera(self, viewpoint: Viewpoint, origin: Index = (0, 0, 0)) -> Orthographic:
        """The camera that sees all of the box, in coordinates of arrays that begin at `origin`."""
        lower, upper = (
            (np.subtract(corner, origin) - 0.5).tolist()
            for corner in (self.box.lower, self.box.upper)
        )
        return turntable(lower, upper, *viewpoint)

    @torch.no_grad()
    def look(self, smoke: Coloured, viewpoint: Viewpoint) -> Seen:
        """A picture of smoke."""
        if 0 in smoke.density.shape:
            nothing = np.zeros((self.size, self.size), np.float32)
            return Seen(
                np.repeat(nothing[..., None], 3, -1), nothing, np.full_like(nothing, np.inf)
            )
        camera = self.camera(viewpoint, smoke.origin)
        view = render(
            torch.from_numpy(smoke.density),
            torch.from_numpy(smoke.colour),
            camera,
            rows=self.size,
            columns=self.size,
            gamma=self.gamma,
            step=STEP,
            supersampling=rays_along(camera.height / self.size),
        )
        return Seen(view.colour.numpy(), view.opacity.numpy(), view.depth.numpy())

    def look_twice(self, painted: Coloured, plain: Coloured, viewpoint: Viewpoint) -> Pair:
        """Both from the same place."""
        return Pair(viewpoint, self.look(painted, viewpoint), self.look(plain, viewpoint))

    def motion(self, smoke: Volume, viewpoint: Viewpoint) -> FloatArray | None:
        """How smoke is seen to move, pixels per frame to the right and down, `[r, c, 2]`.

        None where the smoke has no velocity.
        """
        if smoke.velocity is None or smoke.density.size == 0:
            return None
        moved, _ = projected_velocity(
            torch.from_numpy(smoke.density),
            torch.from_numpy(smoke.velocity),
            self.camera(viewpoint, smoke.origin),
            rows=self.size,
            columns=self.size,
            gamma=self.gamma,
            step=STEP,
        )
        return moved.numpy()
