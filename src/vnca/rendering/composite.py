"""Light gathered along rays through an emitting and absorbing medium."""

import torch
from jaxtyping import Float
from torch import Tensor

from vnca.core.errors import ShapeError


def ray_weights(
    extinction: Float[Tensor, "rays samples"], *, step: float
) -> tuple[Float[Tensor, "rays samples"], Float[Tensor, " rays"]]:
    """How much each sample contributes to its ray, and what is left at the end of it.

    Differentiable in `extinction`. The weights of a ray and its final transmittance add up
    to one.

    Args:
        extinction: σ, 1/cell, non-negative, near to far.
        step: Sample spacing, cells.

    Returns:
        Weights T_k α_k, and the transmittance behind the last sample.

    Reference: Max 1995, eq. 6; derivation in this folder's README.
    """
    thickness = extinction * step
    reached = torch.cumsum(thickness, dim=1)
    weights = torch.exp(thickness - reached) * -torch.expm1(-thickness)
    return weights, torch.exp(-thickness.sum(dim=1))


def composite(
    extinction: Float[Tensor, "rays samples"],
    colour: Float[Tensor, "rays samples 3"],
    *,
    step: float,
) -> tuple[Float[Tensor, "rays 3"], Float[Tensor, " rays"]]:
    """Emission–absorption colour and opacity along each ray, near to far.

    Differentiable in `extinction` and `colour`.

    Args:
        extinction: σ, 1/cell, non-negative.
        colour: Linear RGB.
        step: Sample spacing, cells.

    Returns:
        Premultiplied linear RGB, and opacity in [0, 1].

    Raises:
        ShapeError: If the sample counts differ.

    Reference: Max 1995, eq. 6; derivation in this folder's README.
    """
    check_samples(extinction, colour)
    weights, transmittance = ray_weights(extinction, step=step)
    return gather(weights, colour), 1 - transmittance


def gather(
    weights: Float[Tensor, "rays samples"], colour: Float[Tensor, "rays samples c"]
) -> Float[Tensor, "rays c"]:
    """The weighted sum of the samples of each ray. Differentiable in both."""
    return torch.einsum("rs,rsc->rc", weights, colour)


def check_samples(extinction: Tensor, colour: Tensor) -> None:
    """Raise `ShapeError` unless there is one RGB colour for every sample."""
    if colour.shape != (*extinction.shape, 3):
        raise ShapeError(
            f"colour along rays: expected {(*extinction.shape, 3)} to match the extinction, "
            f"got {tuple(colour.shape)}"
        )
