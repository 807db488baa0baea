"""How far apart two sets of feature vectors are: relaxed earth mover's distance."""

from collections.abc import Callable

import torch
from jaxtyping import Float, Int
from torch import Tensor

Cost = Callable[[Float[Tensor, "*b n c"], Float[Tensor, "*b m c"]], Float[Tensor, "*b n m"]]

# Squared norms are raised to this, which bounds the gradient of the direction of a vector that
# is almost zero. Features have a root mean square near one, so real ones are far above it.
_SMALLEST_SQUARE = 1e-6


def style_distance(x: Float[Tensor, "n c"], y: Float[Tensor, "m c"]) -> Float[Tensor, ""]:
    """Relaxed earth mover's distance between two feature sets with the cosine as cost, in 0–2.

    Differentiable in both; the order of the vectors and their lengths do not matter.
    """
    return relaxed_earth_movers_distance(x, y, cosine_cost)


def cosine_cost(x: Float[Tensor, "*b n c"], y: Float[Tensor, "*b m c"]) -> Float[Tensor, "*b n m"]:
    """One minus the cosine between every vector of `x` and every vector of `y`.

    Differentiable in both, also at zero vectors, which cost one against anything.

    Reference: Kolkin, Salavon and Shakhnarovich 2019, eq. 5.
    """
    return 1 - _direction(x) @ _direction(y).mT


def relaxed_earth_movers_distance(
    x: Float[Tensor, "n c"], y: Float[Tensor, "m c"], cost: Cost
) -> Float[Tensor, ""]:
    """The larger of the two one-sided mean costs of sending every vector to its nearest.

    A lower bound of the earth mover's distance, which would send equal mass everywhere.
    Differentiable in both, almost everywhere.

    Reference: Kolkin, Salavon and Shakhnarovich 2019, eq. 4 (Kusner et al. 2015).
    """
    # The gradient flows through nearest pairs only: n + m of them, not n · m.
    with torch.no_grad():
        every = cost(x, y)
        nearest_to_x, nearest_to_y = every.argmin(1), every.argmin(0)
    there = cost(x[:, None], y[nearest_to_x][:, None]).mean()
    back = cost(x[nearest_to_y][:, None], y[:, None]).mean()
    return torch.maximum(there, back)


def sample_positions(
    count: int, samples: int, generator: torch.Generator, device: torch.device | str = "cpu"
) -> Int[Tensor, " n"]:
    """Up to `samples` different indices below `count`; all of them where there are no more.

    Drawn on the generator's own device, so that one seed gives one sequence everywhere.
    """
    if count <= samples:
        return torch.arange(count, device=device)
    drawn = torch.randperm(count, generator=generator, device=generator.device)
    return drawn[:samples].to(device)


def _direction(x: Tensor) -> Tensor:
    return x * (x * x).sum(-1, keepdim=True).clamp_min(_SMALLEST_SQUARE).rsqrt()
