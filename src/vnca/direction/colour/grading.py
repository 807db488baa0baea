"""Hue, saturation, lightness and exposure of what was painted."""

import numpy as np

from vnca.core import FloatArray
from vnca.direction.colour.oklab import from_oklab, oklab
from vnca.direction.colour.palette import in_range
from vnca.direction.mixing import Answer, per_colour


def graded(
    colour: FloatArray, *, hue: Answer, saturation: Answer, lightness: Answer, exposure: Answer
) -> FloatArray:
    """Colours changed; where nothing is to be changed they stay what they are, to the bit.

    Args:
        colour: `[n, 3]`, linear RGB.
        hue: Degrees by which hues turn, red towards yellow.
        saturation: What the distance from grey is multiplied by.
        lightness: What is added to it, −1 to 1: 0 is black and 1 white.
        exposure: Stops: each doubles the light.
    """
    is_same = np.equal(hue, 0) & np.equal(saturation, 1) & np.equal(lightness, 0)
    if not np.all(is_same):
        lab = oklab(colour)
        angle = np.radians(hue)
        a, b = lab[:, 1].copy(), lab[:, 2].copy()
        lab[:, 0] = np.clip(lab[:, 0] + lightness, 0, 1)
        lab[:, 1] = saturation * (np.cos(angle) * a - np.sin(angle) * b)
        lab[:, 2] = saturation * (np.sin(angle) * a + np.cos(angle) * b)
        is_same = np.broadcast_to(is_same, len(colour))[:, None]
        colour = np.where(is_same, colour, in_range(from_oklab(lab)))
    if np.all(np.equal(exposure, 0)):
        return colour
    light = np.exp2(np.float32(exposure))
    return (colour * per_colour(light if light.ndim else float(light))).astype(np.float32)
