"""What a rule grows so far, to look at while it trains."""

import numpy as np
import torch

from vnca.io.image import resize
from vnca.io.sheet import contact_sheet
from vnca.texturing.loop import TextureTrainer
from vnca.texturing.slices import DIAGONAL, Angles, shown, slice_points
from vnca.typing import FloatArray

SIZE = 256
"""Rows and columns of each slice, pixels."""
SPACING = 0.5
"""Cells a pixel shows."""
SLICES: tuple[Angles, ...] = ((0.0, 0.0), (90.0, 0.0), (0.0, 90.0), (45.0, DIAGONAL))
"""From the front, the right and above, and across a diagonal, which training never does."""


def preview_sheet(trainer: TextureTrainer, style: FloatArray) -> FloatArray:
    """The style beside four slices of a block grown from the seed, linear RGB `[r, c, 3]`.

    Leaves the trainer's random streams as they were, so that looking changes nothing.
    """
    with torch.no_grad():
        block = trainer.scene.block(trainer.grow(2 * trainer.config.longest_rollout))
        pictures = [_square(style)]
        middle = np.full(3, len(block) / 2)
        for angles in SLICES:
            points = slice_points(angles, middle, size=SIZE, spacing=SPACING)
            pictures.append(shown(block, points.to(block.device)).cpu().numpy())
    return contact_sheet([pictures])


def _square(style: FloatArray) -> FloatArray:
    """The middle of the style picture, as large as a slice."""
    rows, columns = style.shape[:2]
    side = min(rows, columns)
    top, left = (rows - side) // 2, (columns - side) // 2
    return np.clip(resize(style[top : top + side, left : left + side], SIZE, SIZE), 0, 1)
