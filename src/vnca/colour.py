"""From the numbers in picture files to light, and back."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Rec. 709 primaries, which sRGB shares.
LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)
_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
# From CIE XYZ to the responses of cones, about.
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


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


def rec709_from(chromaticities: Sequence[float]) -> NDArray[np.float64]:
    """The 3×3 matrix from linear RGB of other primaries to that of Rec. 709.

    White becomes white, as an eye that has adapted to it sees it.

    Args:
        chromaticities: CIE x, y of red, green, blue and white.

    Raises:
        ValueError: If no colours can be made of such primaries.

    Reference: SMPTE RP 177; Lam 1985 (Bradford).
    """
    with np.errstate(all="ignore"):  # refused below
        ours, theirs = (_to_xyz(np.asarray(each, np.float64)) for each in (_REC709, chromaticities))
        white, source = (matrix.sum(1) @ _BRADFORD.T for matrix in (ours, theirs))
        adapted = np.linalg.inv(_BRADFORD) @ np.diag(white / source) @ _BRADFORD
        found = np.linalg.inv(ours) @ adapted @ theirs
    if not np.isfinite(found).all():
        raise ValueError("its primaries are no colours")
    return found


def _to_xyz(chromaticities: NDArray[np.float64]) -> NDArray[np.float64]:
    """The 3×3 matrix from linear RGB to CIE XYZ, where white has a luminance of 1."""
    x, y = chromaticities.reshape(4, 2).T
    xyz = np.stack([x / y, np.ones(4), (1 - x - y) / y])
    try:
        return xyz[:, :3] * np.linalg.solve(xyz[:, :3], xyz[:, 3])
    except np.linalg.LinAlgError:
        raise ValueError("its primaries are no colours") from None


def _floating(value: ArrayLike) -> NDArray[Any]:
    array = np.asarray(value)
    return array if np.issubdtype(array.dtype, np.floating) else array.astype(np.float64)
