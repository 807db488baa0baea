"""How far apart two sets of feature vectors are: their means and covariances."""

from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor


class Moments(NamedTuple):
    """Mean and covariance of a set of vectors."""

    mean: Float[Tensor, " c"]
    covariance: Float[Tensor, "c c"]


def moments(x: Float[Tensor, "n c"]) -> Moments:
    """Mean and covariance (divided by n) of the rows of `x`; differentiable."""
    mean = x.mean(0)
    centred = x - mean
    return Moments(mean, _InnerProducts.apply(centred) / len(x))


def moment_distance(x: Moments, y: Moments) -> Float[Tensor, ""]:
    """Mean absolute difference of the means, plus that of the covariances.

    Reference: the VNCA paper's D_k (Kolkin, Salavon and Shakhnarovich 2019, eq. 7, without
    the normalisation over C').
    """
    return (x.mean - y.mean).abs().mean() + (x.covariance - y.covariance).abs().mean()


class _InnerProducts(torch.autograd.Function):
    """`xᵀx`, with one product in its gradient where autograd takes two."""

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        ctx.save_for_backward(x)
        return x.T @ x

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        (x,) = ctx.saved_tensors
        return x @ (gradient + gradient.T)
