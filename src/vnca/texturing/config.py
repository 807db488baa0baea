"""Every hyperparameter of training a solid texture, with its presets."""

from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Literal

import tyro

from vnca.automaton.rule import RuleConfig
from vnca.errors import OptionError
from vnca.losses.appearance import AppearanceConfig
from vnca.texturing.block import LARGEST, SMALLEST


@dataclass(frozen=True)
class SliceConfig:
    """How the block is looked at while training."""

    size: int = 128
    """Rows and columns of a slice, pixels: cells, but for the zoom."""
    count: int = 2
    """Slices in an iteration."""
    oblique: float = 0.5
    """Share of the slices that lie at any angle; the others lie along the axes."""
    zoom: float = 1.1
    """A pixel shows from 1/zoom to zoom cells."""
    mesh: float = 0.5
    """Share of the pictures that show the mesh, where there is one."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise OptionError(f"--slice.size {self.size}: at least 32 pixels are needed")
        if self.count < 1:
            raise OptionError(f"--slice.count {self.count}: at least 1 is needed")
        for name in ("oblique", "mesh"):
            if not 0 <= getattr(self, name) <= 1:
                raise OptionError(f"--slice.{name} {getattr(self, name)}: must be from 0 to 1")
        if not 1 <= self.zoom <= 4:
            raise OptionError(f"--slice.zoom {self.zoom}: must be from 1 to 4")


@dataclass(frozen=True)
class PoolConfig:
    """The states that rollouts start from."""

    size: int = 16
    """States kept."""
    reseed_every: int = 8
    """Every so many iterations a state is started again from zero."""
    limit: float = 4.0
    """A state with a value beyond this has exploded and is thrown away."""

    def __post_init__(self) -> None:
        if self.size < 1 or self.reseed_every < 1 or not self.limit > 0:
            raise OptionError("--pool.size, --pool.reseed-every and --pool.limit must be positive")


# A texture is the same everywhere and follows nothing.
_PLAIN = RuleConfig(position_prior=False, density_prior=False, velocity_prior=False)


@dataclass(frozen=True)
class TextureConfig:
    """How a rule for a solid texture is trained."""

    rule: Annotated[RuleConfig, tyro.conf.arg(name="")] = _PLAIN
    appearance: AppearanceConfig = field(default_factory=AppearanceConfig)
    slices: Annotated[SliceConfig, tyro.conf.arg(name="slice")] = field(default_factory=SliceConfig)
    pool: PoolConfig = field(default_factory=PoolConfig)
    block: int = 48
    """Cells along an edge of the block that is trained on; patterns are smaller than it."""
    iterations: int = 400
    """Iterations of training."""
    learning_rate: float = 1e-3
    """Adam's learning rate at its highest. Nothing from outside holds a texture's states: at the
    rates that suit smoke, many explode."""
    rate_warmup: int = 15
    """Iterations over which the learning rate rises to it."""
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
    backend: Literal["auto", "native", "reference"] = "auto"
    """What computes the automaton."""
    seed: int = 0
    """Same seed, same machine, same result."""

    def __post_init__(self) -> None:
        rule = self.rule
        if rule.position_prior or rule.density_prior or rule.velocity_prior:
            raise OptionError(
                "--position-prior, --density-prior, --velocity-prior: a solid texture has none"
            )
        if not SMALLEST <= self.block <= LARGEST:
            raise OptionError(f"--block {self.block}: must be from {SMALLEST} to {LARGEST} cells")
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


PRESETS = {
    "draft": TextureConfig(),
    "standard": TextureConfig(
        rule=RuleConfig(
            hidden=128, position_prior=False, density_prior=False, velocity_prior=False
        ),
        slices=SliceConfig(size=192),
        pool=PoolConfig(size=64),
        block=64,
        iterations=3000,
        shortest_rollout=12,
        longest_rollout=48,
    ),
}
"""Training by name: `draft` in minutes on two cores, `standard` in hours or on a GPU."""
