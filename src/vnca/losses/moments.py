"""How far apart two sets of feature vectors are: their means and covariances."""

from typing import NamedTuple

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
    return Moments(mean, centred.T @ centred / len(x))


def moment_distance(x: Moments, y: Moments) -> Float[Tensor, ""]:
    """Mean absolute difference of the means, plus that of the covariances.

    Reference: the VNCA paper's D_k (Kolkin, Salavon and Shakhnarovich 2019, eq. 7, without
    the normalisation over C').
    """
    return (x.mean - y.mean).abs().mean() + (x.covariance - y.covariance).abs().mean()
