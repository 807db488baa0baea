"""How far the slices of a block are from the style: what is compared between methods."""

from typing import NamedTuple

import numpy as np
import torch

from vnca.core.typing import FloatArray
from vnca.losses.appearance import AppearanceLoss
from vnca.training.scenes.slices import FAMILIES, as_picture, shown, slice_points


class SliceDistance(NamedTuple):
    """Mean over slices of one family.

    Attributes:
        total: The appearance loss.
        terms: Its parts, weighted.
    """

    total: float
    terms: dict[str, float]


def slice_distances(
    block: FloatArray, appearance: AppearanceLoss, *, size: int, count: int = 16, seed: int = 0
) -> dict[str, SliceDistance]:
    """Mean appearance loss of fixed slices of a block, family by family.

    The slices, and the positions compared in them, depend on nothing but the seed: blocks of
    any size and origin are asked the same. Those named `unseen` lie where training never looks.

    Args:
        block: Linear RGB `[s, s, s, 3]`.
        appearance: What judges; losses of different ones cannot be compared.
        size: Rows and columns of a slice, pixels of a cell each.
        count: Slices of a family.
        seed: Chooses them.
    """
    values = torch.from_numpy(np.ascontiguousarray(block)).to(appearance.background.device)
    found = {}
    for family, draw in FAMILIES.items():
        random = np.random.default_rng(seed)
        generator = torch.Generator().manual_seed(seed)
        losses = []
        for _ in range(count):
            middle = random.uniform(0, len(block), 3)
            points = slice_points(draw(random), middle, size=size).to(values.device)
            with torch.no_grad():
                colour = shown(values, points)
                losses.append(
                    appearance(as_picture(colour), torch.ones_like(colour[None, ..., 0]), generator)
                )
        terms = {
            name: float(np.mean([float(loss.terms[name]) for loss in losses]))
            for name in losses[0].terms
        }
        found[family] = SliceDistance(float(np.mean([float(loss.total) for loss in losses])), terms)
    return found
