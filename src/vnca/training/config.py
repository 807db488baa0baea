"""Every hyperparameter of training, with its presets."""

import dataclasses
from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Literal

import tyro

from vnca.automaton.rule import RuleConfig
from vnca.errors import OptionError
from vnca.losses.appearance import AppearanceConfig
from vnca.losses.motion import MotionConfig


@dataclass(frozen=True)
class ViewConfig:
    """How the smoke is looked at while training."""

    size: int = 128
    """Rows and columns of a view, pixels."""
    elevation: float = 30.0
    """Views come from up to this many degrees above or below the horizon."""
    step: float = 1.0
    """Distance between samples along a ray, cells."""
    mode: Literal["sane", "paper"] = "sane"
    """Integrand: emission and absorption, or the paper's as printed."""
    cell_opacity: float = 0.95
    """Without a given gamma, one is chosen that makes a typical cell this opaque: high shows the
    texture of the surface, low mixes many cells along a ray."""
    gamma: float | None = None
    """Extinction of density 1, per cell; chosen from the frame unless given."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise OptionError(f"--view.size {self.size}: at least 32 pixels are needed")
        if not 0 <= self.elevation <= 90:
            raise OptionError(f"--view.elevation {self.elevation}: must be 0 to 90 degrees")
        if not 0 < self.step < inf:
            raise OptionError(f"--view.step {self.step}: must be positive")
        if not 0 < self.cell_opacity < 1:
            raise OptionError(f"--view.cell-opacity {self.cell_opacity}: must be between 0 and 1")
        if self.gamma is not None and not 0 < self.gamma < inf:
            raise OptionError(f"--view.gamma {self.gamma}: must be positive")


@dataclass(frozen=True)
class PoolConfig:
    """The states that rollouts start from."""

    size: int = 64
    """States kept."""
    reseed_every: int = 8
    """Every so many iterations a state is started again from zero."""
    limit: float = 4.0
    """A state with a value beyond this has exploded and is thrown away."""

    def __post_init__(self) -> None:
        if self.size < 1 or self.reseed_every < 1 or not self.limit > 0:
            raise OptionError("--pool.size, --pool.reseed-every and --pool.limit must be positive")


@dataclass(frozen=True)
class TrainConfig:
    """How a rule is trained."""

    rule: Annotated[RuleConfig, tyro.conf.arg(name="")] = field(default_factory=RuleConfig)
    appearance: AppearanceConfig = field(default_factory=AppearanceConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    view: ViewConfig = field(default_factory=ViewConfig)
    pool: PoolConfig = field(default_factory=PoolConfig)
    iterations: int = 400
    """Iterations of training."""
    learning_rate: float = 3e-3
    """Adam's learning rate at its highest."""
    rate_warmup: int = 15
    """Iterations over which the learning rate rises to it: a rule that changes states too much at
    once makes them explode."""
    milestones: tuple[float, ...] = (0.6, 0.85)
    """Parts of the iterations after which the learning rate falls."""
    decay: float = 0.4
    """What the learning rate is multiplied by at a milestone."""
    shortest_rollout: int = 8
    """Fewest steps of the automaton in an iteration."""
    longest_rollout: int = 24
    """Most steps of the automaton in an iteration."""
    overflow: float = 100.0
    """Weight of the penalty on states beyond ±1."""
    features: str = "edges"
    """Weights of VGG16: edges, imagenet or a path."""
    backend: Literal["auto", "native", "triton", "reference"] = "auto"
    """What computes the automaton."""
    seed: int = 0
    """Same seed, same machine, same result."""

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise OptionError(f"--iterations {self.iterations}: at least 1 is needed")
        if not (0 < self.learning_rate < inf and 0 < self.decay < inf):
            raise OptionError("--learning-rate and --decay must be positive")
        if self.rate_warmup < 0:
            raise OptionError(f"--rate-warmup {self.rate_warmup}: must not be negative")
        if not all(0 <= part <= 1 for part in self.milestones):
            raise OptionError(
                f"--milestones {' '.join(map(str, self.milestones))}: expected parts of the "
                "iterations, from 0 to 1"
            )
        if not 1 <= self.shortest_rollout <= self.longest_rollout:
            raise OptionError(
                f"--shortest-rollout {self.shortest_rollout}: must be from 1 to "
                f"--longest-rollout ({self.longest_rollout})"
            )
        if not 0 <= self.overflow < inf:
            raise OptionError(f"--overflow {self.overflow}: must not be negative")
        if not 0 <= self.seed < 2**63:
            raise OptionError(f"--seed {self.seed}: must be from 0 to 2^63 - 1")

    def rate(self, iteration: int) -> float:
        """Learning rate of an iteration, counted from 0: a ramp, then a step at each milestone."""
        ramp = min(1.0, (iteration + 1) / (self.rate_warmup + 1))
        passed = sum(iteration >= round(part * self.iterations) for part in self.milestones)
        return self.learning_rate * ramp * self.decay**passed


# A cell that knows where it is paints one frame well; one that does not paints any.
_ANYWHERE = RuleConfig(position_prior=False)

PRESETS = {
    "draft": TrainConfig(rule=_ANYWHERE, pool=PoolConfig(size=16)),
    "standard": TrainConfig(
        iterations=3000,
        learning_rate=2e-3,
        shortest_rollout=12,
        longest_rollout=48,
        view=ViewConfig(size=192),
        pool=PoolConfig(size=128),
        rule=dataclasses.replace(_ANYWHERE, hidden=128),
    ),
    "paper": TrainConfig(
        iterations=5000,
        learning_rate=1e-3,
        shortest_rollout=32,
        longest_rollout=96,
        view=ViewConfig(size=256, elevation=0.0, mode="paper"),
        pool=PoolConfig(size=256),
        rule=RuleConfig(hidden=128),
        appearance=AppearanceConfig(pixels=0.0),
    ),
}
"""Training by name: `draft` in minutes on two cores, `standard` overnight or on a GPU, `paper` as
the paper describes it."""
