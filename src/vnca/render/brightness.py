"""Choosing γ, the paper's brightness control."""

import numpy as np

from vnca.typing import AnyArray


def gamma_for_cell_opacity(density: AnyArray, opacity: float) -> float:
    """Extinction γ of density 1, 1/cell, at which one cell of typical smoke has an opacity.

    Typical is the density met by a random particle of smoke: the mean of d weighted by d. 1 where
    there is no smoke.

    Near 1 a view shows the surface of the smoke, and a texture as fine as its cells; a low
    opacity mixes the colours of many cells along each ray.

    Args:
        density: Any shape, non-negative.
        opacity: In (0, 1).
    """
    total = density.sum(dtype=np.float64)
    if not total > 0:
        return 1.0
    typical = np.square(density, dtype=np.float64).sum() / total
    return float(-np.log1p(-opacity) / typical)
