"""What a rule paints so far, to look at while it trains."""

import numpy as np
import torch

from vnca.core.typing import FloatArray
from vnca.io.film import contact_sheet
from vnca.io.picture import resize
from vnca.training.loop import Trainer

SIZE = 256
"""Rows and columns of each picture, pixels."""


def preview_sheet(trainer: Trainer, style: FloatArray) -> FloatArray:
    """The style beside what a state grown from the seed looks like, linear RGB `[r, c, 3]`.

    Leaves the trainer's random streams as they were, so that looking changes nothing.
    """
    state = trainer.grow(2 * trainer.config.longest_rollout)
    with torch.no_grad():
        preview_views = trainer.scene.preview_views(state, SIZE)
    return contact_sheet([[_square(style), *preview_views]])


def _square(style: FloatArray) -> FloatArray:
    """The middle of the style picture, as large as a preview_view."""
    rows, columns = style.shape[:2]
    side = min(rows, columns)
    top, left = (rows - side) // 2, (columns - side) // 2
    return np.clip(resize(style[top : top + side, left : left + side], SIZE, SIZE), 0, 1)
