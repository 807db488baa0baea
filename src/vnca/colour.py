"""From the numbers in picture files to light, and back."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Rec. 709 primaries, which sRGB shares.
LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)


def srgb_to_linear(value: ArrayLike) -> NDArray[Any]:
    """Decode sRGB to linear light, element by element.

    Both ends are continued so that the curve stays smooth, monotone and invertible: the
    linear piece below 0, the power above 1.

    Args:
        value: Any shape, nominally in [0, 1]. Its floating type is kept.

    Reference: IEC 61966-2-1:1999.
    """
    value = _floating(value)
    power = ((np.maximum(value, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(value <= 0.04045, value / 12.92, power)


def linear_to_srgb(value: ArrayLike) -> NDArray[Any]:
    """Encode linear light as sRGB, element by element: the inverse of `srgb_to_linear`.

    Args:
        value: Any shape, nominally in [0, 1]. Its floating type is kept.

    Reference: IEC 61966-2-1:1999.
    """
    value = _floating(value)
    power = 1.055 * np.maximum(value, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(value <= 0.0031308, value * 12.92, power)


def luminance(rgb: ArrayLike) -> NDArray[Any]:
    """Rec. 709 relative luminance of linear RGB `[..., 3]`, as `[...]`."""
    rgb = _floating(rgb)
    return rgb @ np.asarray(LUMINANCE_WEIGHTS, rgb.dtype)


def _floating(value: ArrayLike) -> NDArray[Any]:
    array = np.asarray(value)
    return array if np.issubdtype(array.dtype, np.floating) else array.astype(np.float64)
