"""OKLab: a space in which equal steps look about equal, and hue stays while lightness changes.

Reference: Ottosson 2020, "A perceptual color space for image processing".
"""

import numpy as np

from vnca.core import AnyArray

_TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
_FROM_LAB, _FROM_CONES = np.linalg.inv(_TO_LAB), np.linalg.inv(_TO_CONES)


def oklab(linear: AnyArray) -> AnyArray:
    """Lightness, green to red, blue to yellow `[..., 3]` of linear RGB, float64."""
    return np.cbrt(linear @ _TO_CONES.T) @ _TO_LAB.T


def from_oklab(lab: AnyArray) -> AnyArray:
    """Linear RGB `[..., 3]`, also beyond 0 to 1 where no screen shows the colour; float64."""
    return (lab @ _FROM_LAB.T) ** 3 @ _FROM_CONES.T
