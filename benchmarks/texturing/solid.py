"""Solid texturing by optimising the block itself: the classical way, as a baseline.

The colours of a block are changed until its slices along the axes look like the picture. Judge
and slices are those of the automaton's training, so that nothing but the method differs; Kopf et
al. search neighbourhoods and match histograms where this descends a gradient.

Reference: Kopf, Fu, Cohen-Or, Deussen, Lischinski and Wong 2007, "Solid Texture Synthesis from 2D
Exemplars".
"""

from collections.abc import Iterator

import numpy as np
import torch

from vnca.core import FloatArray
from vnca.core.colour import linear_to_srgb
from vnca.losses.appearance import AppearanceLoss
from vnca.rendering.colour import srgb_to_linear
from vnca.training.scenes.texture import (
    as_picture,
    axis_angles,
    oblique_angles,
    shown,
    slice_points,
)

LEARNING_RATE = 0.02
SLICES = 3
"""In an iteration, as there are axes."""


def optimised_blocks(
    style: FloatArray,
    appearance: AppearanceLoss,
    size: int,
    *,
    slice_size: int,
    oblique: float = 0.0,
    seed: int = 0,
) -> Iterator[FloatArray]:
    """Blocks `[size, size, size, 3]`, linear RGB, one after each iteration, without end.

    The first has colours of the picture, drawn cell by cell. Opposite faces are neighbours.

    Args:
        style: Linear RGB `[r, c, 3]`.
        appearance: What judges the slices.
        size: Cells along an edge.
        slice_size: Rows and columns of a slice, pixels of a cell each.
        oblique: Share of the slices at any angle; the others lie along the axes.
        seed: Same seed, same blocks.
    """
    random = np.random.default_rng(seed)
    generator = torch.Generator().manual_seed(seed)
    palette = np.clip(linear_to_srgb(style.reshape(-1, 3)), 0.02, 0.98)
    start = palette[random.integers(len(palette), size=size**3)].reshape(size, size, size, 3)
    logits = torch.logit(torch.tensor(start, dtype=torch.float32)).requires_grad_()
    optimiser = torch.optim.Adam([logits], lr=LEARNING_RATE)
    while True:
        block = srgb_to_linear(torch.sigmoid(logits))
        pictures = []
        for _ in range(SLICES):
            draw = oblique_angles if random.uniform() < oblique else axis_angles
            middle = random.uniform(0, size, 3)
            pictures.append(
                as_picture(shown(block, slice_points(draw(random), middle, size=slice_size)))
            )
        opaque = torch.ones(SLICES, slice_size, slice_size)
        optimiser.zero_grad()
        appearance(torch.cat(pictures), opaque, generator).total.backward()
        optimiser.step()
        with torch.no_grad():
            yield srgb_to_linear(torch.sigmoid(logits)).numpy()
