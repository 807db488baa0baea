"""A soft background: light in the middle, darker towards the corners."""

from collections.abc import Sequence

import numpy as np

from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.core.typing import AnyArray, FloatArray

_RAISED, _LOWERED = 0.8, 0.4
# Interleaved gradient noise: neighbouring pixels are spread evenly over a step.
_NOISE = (52.9829189, 0.06711056, 0.00583715)


def soft_background(colour: Sequence[float], rows: int, columns: int) -> FloatArray:
    """A colour with a radial gradient around it: black stays black and white stays white there.

    It is dithered by a step of 8-bit sRGB, the same in every picture, as a dark gradient would
    show bands.

    Args:
        colour: Linear RGB, which the background has midway between the middle and the corners.
        rows: Height, pixels.
        columns: Width, pixels.

    Returns:
        Linear RGB `[rows, columns, 3]`.

    Reference: Jimenez 2014, interleaved gradient noise.
    """
    row, column = np.mgrid[:rows, :columns].astype(np.float64)
    y, x = (2 * row + 1) / rows - 1, (2 * column + 1) / columns - 1
    away = np.sqrt((x**2 + y**2) / 2)  # 1 in the corners
    weight = np.cos(np.pi * np.minimum(away, 1))[..., None]
    base = np.asarray(colour, np.float64)
    gain: AnyArray = np.where(weight > 0, _RAISED * (1 - base), _LOWERED)
    soft = linear_to_srgb(base * (1 + gain * weight))
    big, across, down = _NOISE
    noise = (big * ((across * column + down * row) % 1)) % 1 - 0.5
    dithered = soft + np.where(base > 0, noise[..., None] / 255, 0)
    return srgb_to_linear(np.clip(dithered, 0, 1)).astype(np.float32)
