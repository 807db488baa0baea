"""The layer that a rule for a flat texture is trained on: seen whole, and moving if it is to."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from vnca.core import FloatArray
from vnca.painting.flat import conditioned, flat_domain
from vnca.rule import Rule
from vnca.training.config import SliceConfig
from vnca.training.scenes.texture import (
    DECODED_CELLS,
    PREVIEW_CELLS,
    Angles,
    BlockScene,
    Cut,
    averaged,
    shown,
    slice_points,
)

FRONT: Angles = (0.0, 0.0)


class FlatScene(BlockScene):
    """A layer one cell thick; its slices are the picture itself, or windows of it.

    Attributes:
        moves: Whether the pattern is to move.
    """

    dimensions = 2

    def __init__(
        self,
        size: int,
        slices: SliceConfig,
        rule: Rule,
        *,
        velocity: FloatArray | None = None,
        device: torch.device | str = "cpu",
        backend: str = "auto",
    ) -> None:
        """Prepare a layer.

        Args:
            size: Cells along a side.
            slices: How it is looked at.
            rule: Its normalisers, switches and decoder are used.
            velocity: What the pattern is to move by, `[size, 1, size, 3]`, cells per frame.
            device: Where rollouts and pictures are computed.
            backend: What decodes.

        Raises:
            OptionError: If the size cannot work.
        """
        domain = flat_domain(size, size)
        super().__init__(
            size,
            slices,
            conditioning_width=rule.config.conditioning_width,
            domain=domain,
            decoder=rule.decoder,
            device=device,
            backend=backend,
        )
        self.priors = torch.from_numpy(conditioned(rule, domain, velocity)).to(device)
        if velocity is None:
            velocity = np.zeros((size, 1, size, 3), np.float32)
        self.moves = bool(velocity.any())
        self._velocity = torch.from_numpy(velocity).to(device)

    def angles(self, random: np.random.Generator) -> Angles:
        """From the front: there is no other side."""
        del random
        return FRONT

    @torch.no_grad()
    def motion(self, state: Tensor, viewpoint: list[Cut], size: int) -> tuple[Tensor, Tensor]:
        """How the first of the `pictures` is to move: pixels per frame `[s, s, 2]`, and opacity.

        `size` is that of such a picture, rows and columns. Pixels go right and down.
        """
        points = viewpoint[0].points
        width = points.shape[1] * (points[0, 1, 0] - points[0, 0, 0])
        # Linear in the pixels: interpolated, they are the centres of larger ones.
        coarser = functional.interpolate(
            points.permute(2, 0, 1)[None], (size, size), mode="bilinear", align_corners=False
        )
        velocity = shown(self._velocity, coarser[0].permute(1, 2, 0))[..., ::2]
        flow = velocity * (velocity.new_tensor([1.0, -1.0]) * size / width)
        return flow, state.new_ones(size, size)

    def preview_views(self, state: Tensor, size: int) -> list[FloatArray]:
        """From near, and twice as much."""
        cells = PREVIEW_CELLS / 2 if self.decoder is None else DECODED_CELLS
        across, middle = self.slices.supersampling * size, np.full(3, cells / 2)
        views = []
        for times in (1, 2):
            spacing = times * cells / across
            points = slice_points(FRONT, middle, size=across, spacing=spacing).to(state.device)
            colour = averaged(self.shown(state, points), self.slices.supersampling)
            views.append(colour.cpu().numpy())
        return views
