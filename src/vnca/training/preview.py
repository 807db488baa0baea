"""What a rule paints so far, to look at while it trains."""

from dataclasses import replace

import numpy as np
import torch

from vnca.io.image import resize
from vnca.io.sheet import contact_sheet
from vnca.training.loop import Trainer
from vnca.typing import FloatArray

SIZE = 256
"""Rows and columns of each view, pixels."""
VIEWS = ((0.0, 0.0), (90.0, 0.0), (180.0, 0.0), (30.0, 60.0))
"""Azimuth and elevation: front, right, back and from above, degrees."""
STEP = 0.5
"""Distance between samples along a ray, cells: finer than in training, without terraces."""
BACKGROUND = 0.01
"""Linear grey behind the smoke."""


def preview_sheet(trainer: Trainer, style: FloatArray) -> FloatArray:
    """The style beside four views of a state grown from the seed, linear RGB `[r, c, 3]`.

    Leaves the trainer's random streams as they were, so that looking changes nothing.
    """
    state = trainer.grow(2 * trainer.config.longest_rollout)
    view = trainer.config.view
    if view.mode == "sane":
        view = replace(view, step=STEP)
    pictures = [_square(style)]
    for azimuth, elevation in VIEWS:
        camera = trainer.scene.camera(azimuth, elevation)
        with torch.no_grad():
            seen = trainer.scene.look(state, camera, view, size=SIZE)
        pictures.append(seen.over([BACKGROUND] * 3).clamp(0, 1).cpu().numpy())
    return contact_sheet([pictures])


def _square(style: FloatArray) -> FloatArray:
    """The middle of the style picture, as large as a view."""
    rows, columns = style.shape[:2]
    side = min(rows, columns)
    top, left = (rows - side) // 2, (columns - side) // 2
    return np.clip(resize(style[top : top + side, left : left + side], SIZE, SIZE), 0, 1)
