"""Where the smoke of a sequence is looked at: cameras framed on all of it."""

from dataclasses import dataclass

import numpy as np
import torch

from vnca.automaton.rule import Rule
from vnca.camera import Orthographic, Perspective, frame_box
from vnca.render.velocity import projected_velocity
from vnca.render.view import View, render
from vnca.typing import AnyArray, Box, FloatArray, Index
from vnca.volume import Volume

PLAIN = 0.2140411
"""Linear grey of smoke that nothing has painted: sRGB ½, the colour of a state of zeros."""
STEP = 0.5
"""Distance between samples along a ray, cells."""


@dataclass(frozen=True)
class Stage:
    """How a sequence is looked at.

    Attributes:
        box: Holds the smoke of all frames; pictures are framed on it.
        gamma: Extinction of density 1 in the units of the files, 1/cell.
        size: Rows and columns of the pictures.
    """

    box: Box
    gamma: float
    size: int = 192

    @classmethod
    def of(cls, rule: Rule, box: Box, size: int = 192) -> "Stage":
        """As bright as the smoke that a rule was trained on."""
        return cls(box, rule.scales.gamma / rule.scales.density, size)

    def camera(self, origin: Index, azimuth: float, elevation: float) -> Orthographic | Perspective:
        """The camera that sees all of the box, in coordinates of arrays that begin at `origin`."""
        lower, upper = (
            (np.subtract(corner, origin) - 0.5).tolist()
            for corner in (self.box.lower, self.box.upper)
        )
        return frame_box(lower, upper, azimuth, elevation)

    @torch.no_grad()
    def look(
        self,
        density: FloatArray,
        colour: FloatArray | None,
        origin: Index,
        azimuth: float,
        elevation: float,
    ) -> View:
        """A view of smoke; `colour` is linear RGB `[x, y, z, 3]`, or None for plain grey."""
        if colour is None:
            colour = np.full((*density.shape, 3), PLAIN, np.float32)
        return render(
            torch.from_numpy(density),
            torch.from_numpy(colour),
            self.camera(origin, azimuth, elevation),
            rows=self.size,
            columns=self.size,
            gamma=self.gamma,
            step=STEP,
        )

    def motion(self, smoke: Volume, azimuth: float, elevation: float) -> AnyArray:
        """How the smoke is seen to move, pixels per frame to the right and down, `[r, c, 2]`."""
        assert smoke.velocity is not None, "asked of smoke that has no velocity"
        moved, _ = projected_velocity(
            torch.from_numpy(smoke.density),
            torch.from_numpy(smoke.velocity),
            self.camera(smoke.origin, azimuth, elevation),
            rows=self.size,
            columns=self.size,
            gamma=self.gamma,
        )
        return moved.numpy()
