"""Does the painted texture move as the smoke does?"""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from jaxtyping import Bool, Float
from torch import Tensor

from vnca.core.errors import OptionError

_SMALLEST_SQUARE = 1e-12


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
    speed = (seen.square().sum(-1) + _SMALLEST_SQUARE).sqrt()
    target_speed = target.norm(dim=-1)
    cosine = (seen * target).sum(-1) / (speed * target_speed).clamp_min(_SMALLEST_SQUARE)
    return Motion((1 - cosine).sum() / count, (speed - target_speed).abs().sum() / count)


def motion_loss(motion: Motion, config: MotionConfig) -> Float[Tensor, ""]:
    """λ_dir L_dir + max(0, 1 − L_dir) λ_mag L_mag.

    As printed, the paper's factor max(0, L_dir − 1) would let the speed count only while the
    direction is wrong, against the text beside it.

    Reference: VNCA section 3.4, L_motion.
    """
    rightness = (1 - motion.direction.detach()).clamp_min(0)
    return config.direction * motion.direction + rightness * config.magnitude * motion.magnitude
