"""The integrand as the VNCA paper prints it, for comparison with its figures."""

import torch
from jaxtyping import Float
from torch import Tensor

from vnca.rendering.composite import check_samples, gather


def paper_weights(
    density: Float[Tensor, "rays samples"], *, gamma: float
) -> tuple[Float[Tensor, "rays samples"], Float[Tensor, " rays"]]:
    """The paper's weights d_k τ_k, and the transmittance behind the last sample.

    Differentiable in `density`. τ_k counts the absorption of sample k itself, and the
    emission d_k does not scale with γ; so the weights of a ray tend to 1/γ, not to its
    opacity, and they depend on the spacing of the samples, which is one cell.

    Args:
        density: max(d (1 + Δd), 0), near to far, one sample a cell.
        gamma: Absorption of one cell of density one.
    """
    transmittance = torch.exp(-gamma * torch.cumsum(density, dim=1))
    return density * transmittance, torch.exp(-gamma * density.sum(dim=1))


def paper_composite(
    density: Float[Tensor, "rays samples"],
    colour: Float[Tensor, "rays samples 3"],
    *,
    gamma: float,
) -> tuple[Float[Tensor, "rays 3"], Float[Tensor, " rays"]]:
    """The paper's pixel colour, and one minus the final transmittance as opacity.

    Differentiable in `density` and `colour`.

    Args:
        density: max(d (1 + Δd), 0), near to far, one sample a cell.
        colour: Linear RGB.
        gamma: Absorption of one cell of density one.

    Raises:
        ShapeError: If the sample counts differ.

    Reference: VNCA, the equation for P; this folder's README lists what differs from
    `composite`.
    """
    check_samples(density, colour)
    weights, transmittance = paper_weights(density, gamma=gamma)
    return gather(weights, colour), 1 - transmittance
