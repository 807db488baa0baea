"""Motion blur: what a shutter that stays open for a part of a frame makes of a picture."""

from math import ceil

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from vnca.core import FloatArray

MOST_TAPS = 32
"""Times at which a pixel is looked up, at most: half a pixel apart for movements of 16 pixels."""
_TAP = 0.5
"""Pixels between two of them."""
_SOLID = 0.5
"""Opacity from which on a pixel moves as what it shows; thinner ones move with what is beside."""
_FEWEST = 1e-4


def blurred(picture: FloatArray, motion: FloatArray, shutter: float) -> FloatArray:
    """A picture as a shutter sees it that is open around the moment that it shows.

    Each pixel becomes the mean of what passes through it: it is looked up along its own motion.
    Beside what moves, where nothing is seen yet, motion is that of what is near.

    Args:
        picture: `[r, c, k]`, premultiplied, the last channel opacity.
        motion: `[r, c, 2]`, pixels a frame to the right and down, of what is seen in each pixel.
        shutter: Share of a frame during which it is open; 0 leaves the picture as it is.

    Returns:
        `[r, c, k]`, of the same type.
    """
    reach = shutter * float(np.linalg.norm(motion, axis=-1).max(initial=0))
    if reach < _TAP:
        return picture
    moved = _spread(motion, picture[..., -1], reach)
    taps = min(ceil(reach / _TAP) + 1, MOST_TAPS)
    at = np.indices(picture.shape[:2], np.float32)
    along = moved[..., ::-1].transpose(2, 0, 1)  # down, right
    result = np.zeros(picture.shape, np.float32)
    for time in (np.arange(taps, dtype=np.float32) + 0.5) / taps - 0.5:
        where = at - shutter * time * along
        for channel in range(picture.shape[-1]):
            result[..., channel] += map_coordinates(
                picture[..., channel], where, order=1, mode="nearest"
            )
    return (result / taps).astype(picture.dtype)


def _spread(motion: FloatArray, opacity: FloatArray, reach: float) -> FloatArray:
    """The motion, where little is seen that of what is near."""
    weight = opacity.astype(np.float32)
    width = max(reach / 2, 1.0)
    near = gaussian_filter(weight, width)
    sums = [gaussian_filter(motion[..., axis] * weight, width) for axis in range(2)]
    beside = np.stack(sums, -1) / np.maximum(near, _FEWEST)[..., None]
    solid = np.minimum(weight / _SOLID, 1)[..., None]
    return (solid * motion + (1 - solid) * beside).astype(np.float32)
