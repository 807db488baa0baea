"""Terms of a loss, each a function of tensors: style, distributions, palette, overflow, motion."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from vnca.core.errors import OptionError

Cost = Callable[[Float[Tensor, "*b n c"], Float[Tensor, "*b m c"]], Float[Tensor, "*b n m"]]

# Squared norms are raised to this, which bounds the gradient of the direction of a vector that
# is almost zero. Features have a root mean square near one, so real ones are far above it.
_SHORTEST_SQUARE = 1e-6
# Analogue YUV (BT.601): brightness apart from two differences of colour
_YUV = (
    (0.299, 0.587, 0.114),
    (-0.14713, -0.28886, 0.436),
    (0.615, -0.51499, -0.10001),
)
_SMALLEST_COLOUR_SQUARE = 1e-8


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
    there = cost(x[:, None], chosen_rows(y, nearest_to_x)[:, None]).mean()
    back = cost(chosen_rows(x, nearest_to_y)[:, None], y[:, None]).mean()
    return torch.maximum(there, back)


def sliced_distance(
    x: Float[Tensor, "n c"], directions: Float[Tensor, "c k"], other: Float[Tensor, "q k"]
) -> Float[Tensor, ""]:
    """Sliced Wasserstein distance between two sets of vectors.

    Both are seen along directions, sorted there, and compared number by number: the mean
    difference. Along enough directions it is zero for equal distributions alone, where the relaxed
    earth mover's distance is so for the same vectors in other shares, too. Differentiable, almost
    everywhere.

    Args:
        x: One set.
        directions: Along which both are seen.
        other: What `ordered` finds of the other set there, which may have more vectors, or fewer.

    Reference: Rabin et al. 2011; Heitz et al. 2021 (of a network's features, for textures).
    """
    one = ordered(x, directions)
    # As many quantiles as the smaller set has vectors: each of the larger takes part in some.
    count = min(len(one), len(other))
    return (_quantiles(one, count) - _quantiles(other, count)).abs().mean()


def ordered(
    x: Float[Tensor, "n c"], directions: Float[Tensor, "c k"], most: int | None = None
) -> Float[Tensor, "q k"]:
    """What is seen of vectors along directions, in ascending order; as so many quantiles at most.

    Differentiable, almost everywhere.
    """
    # Rows are sorted in less time than columns.
    found = (directions.T @ x.T).sort(-1).values.T
    return found if most is None or most >= len(found) else _quantiles(found, most)


def unit_vectors(size: int, count: int, generator: torch.Generator) -> Float[Tensor, "c k"]:
    """Random directions, in columns."""
    drawn = torch.randn(size, count, generator=generator)
    return drawn / drawn.norm(dim=0)


def _quantiles(known: Float[Tensor, "n k"], count: int) -> Float[Tensor, "q k"]:
    """So many quantiles of columns in ascending order, interpolated."""
    if len(known) == count:
        return known
    numbers = torch.arange(count, device=known.device, dtype=known.dtype)
    at = (numbers + 0.5) * (len(known) / count) - 0.5
    lower = at.floor().clamp(0, len(known) - 1)
    part = (at - lower).clamp(0, 1)[:, None]
    lower = lower.long()
    upper = (lower + 1).clamp_max(len(known) - 1)
    return torch.lerp(chosen_rows(known, lower), chosen_rows(known, upper), part)


def chosen_rows(x: Float[Tensor, "n c"], where: Tensor) -> Float[Tensor, "m c"]:
    """Some of the vectors, by their numbers `[m]`.

    Their gradient is added by rows, which is quicker than that of indexing, number by number.
    """
    return x.index_select(0, where)


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
    return x * (x * x).sum(-1, keepdim=True).clamp_min(_SHORTEST_SQUARE).rsqrt()


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


def to_yuv(rgb: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """BT.601 brightness in 0–1 and two colour differences about zero, from sRGB in 0–1."""
    return rgb @ rgb.new_tensor(_YUV).T


def palette_distance(x: Float[Tensor, "n 3"], y: Float[Tensor, "m 3"]) -> Float[Tensor, ""]:
    """Relaxed earth mover's distance between two sets of sRGB pixels.

    The cost is the Euclidean distance in YUV plus one minus the cosine there. Differentiable in
    both.

    Reference: Kolkin, Salavon and Shakhnarovich 2019, section 2.3 (L_p).
    """
    return relaxed_earth_movers_distance(to_yuv(x), to_yuv(y), _yuv_cost)


def luma(rgb: Float[Tensor, "b 3 r c"]) -> Float[Tensor, "b 3 r c"]:
    """The BT.601 brightness of sRGB in all three channels."""
    weights = rgb.new_tensor(_YUV[0]).view(1, 3, 1, 1)
    return (rgb * weights).sum(1, keepdim=True).expand_as(rgb)


def _yuv_cost(x: Tensor, y: Tensor) -> Tensor:
    inner = x @ y.mT
    squares = (x * x).sum(-1)[..., :, None] + (y * y).sum(-1)[..., None, :] - 2 * inner
    return squares.clamp_min(_SMALLEST_COLOUR_SQUARE).sqrt() + cosine_cost(x, y)


def overflow(state: Float[Tensor, "*cells c"]) -> Float[Tensor, ""]:
    """Mean distance of the state's values from the interval −1 to 1; differentiable.

    Reference: Niklasson et al. 2021 (the overflow loss of texture automata).
    """
    return (state - state.clamp(-1, 1)).abs().mean()


_SLOWEST_SQUARE = 1e-12


@dataclass(frozen=True)
class MotionConfig:
    """What the seen motion is compared with, and how strongly."""

    weight: float = 1.0
    """Weight of motion relative to the median appearance loss, λ; 0 leaves it out."""
    direction: float = 1.0
    """Weight of the direction, λ_dir."""
    magnitude: float = 1.0
    """Weight of the speed, λ_mag; it acts as far as the direction is right."""
    size: int = 96
    """Rows and columns of the pictures in which motion is looked for, at most those of a view."""
    opacity_threshold: float = 0.5
    """Compare only where the smoke is at least this opaque."""
    slowest: float = 0.1
    """Compare only where the smoke moves by at least so many pixels a frame."""
    balance_over: int = 25
    """Iterations of which the median appearance loss is taken; with 0 the weight is absolute."""

    def __post_init__(self) -> None:
        for name in ("weight", "direction", "magnitude", "slowest"):
            if not 0 <= getattr(self, name) < inf:
                raise OptionError(f"`motion.{name}` {getattr(self, name)}: must be 0 or more")
        if self.size < 32:
            raise OptionError(f"`motion.size` {self.size}: at least 32 pixels are needed")
        if not 0 <= self.opacity_threshold < 1:
            raise OptionError(
                f"`motion.opacity_threshold` {self.opacity_threshold}: must be at least 0 and "
                "below 1"
            )
        if self.balance_over < 0:
            raise OptionError(f"`motion.balance_over` {self.balance_over}: must be 0 or more")


class Motion(NamedTuple):
    """How far the seen motion is from the smoke's; lower is better."""

    direction: Float[Tensor, ""]
    """Mean cosine distance, 0 to 2."""
    magnitude: Float[Tensor, ""]
    """Mean difference of speeds, pixels per frame."""


def supervised(
    target: Float[Tensor, "*b r c 2"], opacity: Float[Tensor, "*b r c"], config: MotionConfig
) -> Bool[Tensor, "*b r c"]:
    """Where motion can be compared: in opaque smoke that moves."""
    return (opacity > config.opacity_threshold) & (target.norm(dim=-1) > config.slowest)


def compare_motion(
    seen: Float[Tensor, "*b r c 2"],
    target: Float[Tensor, "*b r c 2"],
    where: Bool[Tensor, "*b r c"],
) -> Motion:
    """Direction and speed of one flow against another, over the chosen pixels.

    Differentiable in `seen`, also where it is zero. Both distances are zero where nothing is
    chosen.

    Args:
        seen: Pixels per frame, N/n times the flow of a picture n of N steps later.
        target: Pixels per frame.
        where: Pixels to compare.

    Reference: VNCA section 3.4, L_dir and L_mag.
    """
    seen, target = seen[where], target[where]
    count = max(1, len(seen))
    speed = (seen.square().sum(-1) + _SLOWEST_SQUARE).sqrt()
    target_speed = target.norm(dim=-1)
    cosine = (seen * target).sum(-1) / (speed * target_speed).clamp_min(_SLOWEST_SQUARE)
    return Motion((1 - cosine).sum() / count, (speed - target_speed).abs().sum() / count)


def motion_loss(motion: Motion, config: MotionConfig) -> Float[Tensor, ""]:
    """λ_dir L_dir + max(0, 1 − L_dir) λ_mag L_mag.

    As printed, the paper's factor max(0, L_dir − 1) would let the speed count only while the
    direction is wrong, against the text beside it.

    Reference: VNCA section 3.4, L_motion.
    """
    rightness = (1 - motion.direction.detach()).clamp_min(0)
    return config.direction * motion.direction + rightness * config.magnitude * motion.magnitude
