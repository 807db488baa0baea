"""What training takes whatever it trains on: the hyperparameters that all trainings share."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import inf

from vnca.core.errors import OptionError
from vnca.engine.session import Compute
from vnca.losses.appearance import AppearanceConfig
from vnca.rule.decoder import Decoder
from vnca.rule.rule import RuleConfig


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
            raise OptionError("`pool.size`, `pool.reseed_every` and `pool.limit` must be positive")


@dataclass(frozen=True)
class Pictures:
    """The pictures that are compared with the style in an iteration.

    Attributes:
        option: What sets their size.
        size: Rows and columns, pixels.
        count: How many there are.
    """

    option: str
    size: int
    count: int


@dataclass(frozen=True)
class TrainingConfig(ABC):
    """How a rule is trained, on whatever it is trained."""

    rule: RuleConfig = field(default_factory=RuleConfig)
    """The shape of the rule."""
    appearance: AppearanceConfig = field(default_factory=AppearanceConfig)
    """What is compared with the picture."""
    pool: PoolConfig = field(default_factory=PoolConfig)
    """The states that rollouts start from."""
    decoder: int = 32
    """Units in each layer of the decoder, which draws between cells what is finer than they are;
    0 for none: cells are then interpolated."""
    graft: str = "none"
    """The rule of another picture that the texture starts from, which takes fewer
    iterations: a style of the library, a model, auto for the nearest style that fits, or none."""
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
    features: str = "efficientnet"
    """Network that compares pictures: efficientnet, edges, imagenet, vgg16 (imagenet where it was
    fetched before, else edges), or the path of a VGG's weights."""
    backend: str = "auto"
    """What computes the automaton: auto, native, triton or reference."""
    seed: int = 0
    """Same seed, same machine, same result."""

    def __post_init__(self) -> None:
        Compute(self.backend)
        if not 0 <= self.decoder <= 128:
            raise OptionError(f"`decoder` {self.decoder}: must be from 0 to 128 units")
        if self.iterations < 1:
            raise OptionError(f"`iterations` {self.iterations}: at least 1 is needed")
        if not (0 < self.learning_rate < inf and 0 < self.decay < inf):
            raise OptionError("`learning_rate` and `decay` must be positive")
        if self.rate_warmup < 0:
            raise OptionError(f"`rate_warmup` {self.rate_warmup}: must not be negative")
        if not all(0 <= part <= 1 for part in self.milestones):
            raise OptionError(
                f"`milestones` {' '.join(map(str, self.milestones))}: expected parts of the "
                "iterations, from 0 to 1"
            )
        if not 1 <= self.shortest_rollout <= self.longest_rollout:
            raise OptionError(
                f"`shortest_rollout` {self.shortest_rollout}: must be from 1 to "
                f"`longest_rollout` ({self.longest_rollout})"
            )
        if not 0 <= self.overflow < inf:
            raise OptionError(f"`overflow` {self.overflow}: must not be negative")
        if not 0 <= self.seed < 2**63:
            raise OptionError(f"`seed` {self.seed}: must be from 0 to 2^63 - 1")

    @property
    @abstractmethod
    def pictures(self) -> Pictures:
        """What is looked at in an iteration."""

    def initial_decoder(self) -> Decoder | None:
        """The decoder before training, if there is to be one."""
        if self.decoder == 0:
            return None
        return Decoder.initial(self.rule.channels, seed=self.seed, units=self.decoder)

    def rate(self, iteration: int) -> float:
        """Learning rate of an iteration, counted from 0: a ramp, then a step at each milestone."""
        ramp = min(1.0, (iteration + 1) / (self.rate_warmup + 1))
        passed = sum(iteration >= round(part * self.iterations) for part in self.milestones)
        return self.learning_rate * ramp * self.decay**passed
