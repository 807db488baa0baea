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
    typical = _typical(density)
    return float(-np.log1p(-opacity) / typical) if typical else 1.0


def gamma_for_own_colour(density: AnyArray) -> float:
    """Extinction γ of density 1, 1/cell, at which the paper's integrand shows smoke as it is.

    There emission does not grow with γ: the weights of a ray through cells of one density d that
    let nothing through add up to d / (exp(γ d) − 1). They are 1 at this γ, where d is the density
    of typical smoke: it is as bright as its colour. At a γ that makes a cell opaque by emission and
    absorption it is nearly black. 1 where there is no smoke.

    Args:
        density: Any shape, non-negative.
    """
    typical = _typical(density)
    return float(np.log1p(typical) / typical) if typical else 1.0


def _typical(density: AnyArray) -> float:
    """The density met by a random particle of smoke; 0 where there is none."""
    total = density.sum(dtype=np.float64)
    return float(np.square(density, dtype=np.float64).sum() / total) if total > 0 else 0.0
