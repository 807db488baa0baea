"""The 3×3×3 filters of perception, frozen during training.

Reference: VNCA section 3.3 (Sobel and 27-point Laplacian, after O'Reilly and Beck 2006).
"""

import itertools

import numpy as np

from vnca.core.typing import FloatArray, IntArray

NEIGHBOURS = 27
FILTERS = 5
"""Identity, gradient along x, y and z, Laplacian."""

OFFSETS: IntArray = np.array(list(itertools.product((-1, 0, 1), repeat=3)), dtype=np.int32)
"""`[27, 3]` offsets of a cell's neighbours (itself is number 13), z fastest."""


def stencil(*, sobel_divisor: float = 32.0, laplacian_divisor: float = 26.0) -> FloatArray:
    """Weights `[5, 27]` of identity, Sobel x, y, z and Laplacian over `OFFSETS`.

    With the default divisors the gradient of a unit ramp is exactly 1 and the Laplacian of r²
    exactly 6.
    """
    smooth = np.array([1, 2, 1])[OFFSETS + 1]
    distance = np.abs(OFFSETS).sum(axis=1)
    identity = (distance == 0).astype(np.float64)
    sobel_x = OFFSETS[:, 0] * smooth[:, 1] * smooth[:, 2] / sobel_divisor
    sobel_y = OFFSETS[:, 1] * smooth[:, 0] * smooth[:, 2] / sobel_divisor
    sobel_z = OFFSETS[:, 2] * smooth[:, 0] * smooth[:, 1] / sobel_divisor
    laplacian = np.array([-88, 6, 3, 2])[distance] / laplacian_divisor
    return np.stack([identity, sobel_x, sobel_y, sobel_z, laplacian]).astype(np.float32)
