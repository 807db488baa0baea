"""Choosing γ, the paper's brightness control."""

import numpy as np

from vnca.typing import AnyArray


def gamma_for_opacity(density: AnyArray, opacity: float) -> float:
    """Extinction γ of density 1, 1/cell, at which the smoke has the given mean opacity.

    Seen along each axis in turn; the mean is over the pixels whose optical depth is at least a
    tenth of the deepest, so that faint fringes do not count. 1 where there is no smoke.

    Args:
        density: `[x, y, z]`, non-negative.
        opacity: Mean opacity wanted, in (0, 1).
    """
    if density.size == 0 or not density.max() > 0:
        return 1.0
    depths = [density.sum(axis=axis, dtype=np.float64).ravel() for axis in range(3)]
    depth = np.concatenate([d[d > 0.1 * d.max()] for d in depths])
    low, high = 1e-6, 1e6
    for _ in range(60):  # halvings of the logarithm: far below float32's resolution
        middle = np.sqrt(low * high)
        if np.mean(-np.expm1(-middle * depth)) < opacity:
            low = middle
        else:
            high = middle
    return float(high)
