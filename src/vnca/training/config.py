"""Every hyperparameter of training: those that all trainings share, of smoke, of textures."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import inf
from typing import Literal

from vnca.core.errors import OptionError
from vnca.engine import Compute
from vnca.losses import MotionConfig
from vnca.losses.appearance import AppearanceConfig
from vnca.painting.block import LARGEST, SMALLEST
from vnca.rule import Decoder, RuleConfig


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
    xavier_gain: float = 0.0
    """Begin with a hidden layer of Xavier's normal distribution with this gain, as the authors'
    later code does with 0.2; 0 for He's uniform one."""
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
    steadiness: float = 0.0
    """Weight of how much a rollout changes a grown state, relative to the median appearance loss:
    the rule learns to keep its pattern. 0 leaves it out."""
    consistency: float = 0.0
    """Weight of how much a rollout changes what is seen of a grown state, likewise: strokes flow
    with the smoke and do not flicker. 0 leaves it out."""
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
        if not 0 <= self.xavier_gain < inf:
            raise OptionError(f"`xavier_gain` {self.xavier_gain}: must not be negative")
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
        for name in ("overflow", "steadiness", "consistency"):
            if not 0 <= getattr(self, name) < inf:
                raise OptionError(f"`{name}` {getattr(self, name)}: must not be negative")
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


@dataclass(frozen=True)
class ViewConfig:
    """How the smoke is looked at while training."""

    size: int = 128
    """Rows and columns of a view, pixels."""
    pixels_per_cell: float | None = None
    """Pixels that show a cell: a view then shows a part of the smoke, from as near as that takes;
    all of the smoke unless given."""
    supersampling: int = 2
    """Rays along the rows and the columns of a pixel, where a decoder draws what is finer than
    pixels."""
    azimuths: tuple[float, ...] = ()
    """Views come from these degrees around the smoke; from all around unless given."""
    elevation: float = 30.0
    """Views come from up to this many degrees above or below the horizon."""
    step: float = 1.0
    """Distance between samples along a ray, cells."""
    mode: Literal["emission-absorption", "paper"] = "emission-absorption"
    """Integrand: emission and absorption, or the paper's as printed."""
    cell_opacity: float = 0.95
    """Without a given gamma, one is chosen that makes a typical cell this opaque: high shows the
    texture of the surface, low mixes many cells along a ray. For the paper's integrand it is chosen
    so that typical smoke is as bright as its colour."""
    gamma: float | None = None
    """Extinction of density 1, per cell; chosen from the frame unless given."""
    thinnest: float = 1.0
    """The least part of that gamma with which smoke is seen in training, for a pattern to show in
    translucent smoke: half of the views draw one between it and 1, evenly in proportion."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise OptionError(f"`view.size` {self.size}: at least 32 pixels are needed")
        if self.pixels_per_cell is not None and not 0 < self.pixels_per_cell <= 64:
            raise OptionError(
                f"`view.pixels_per_cell` {self.pixels_per_cell:g}: must be above 0, at most 64"
            )
        if not 1 <= self.supersampling <= 8:
            raise OptionError(f"`view.supersampling` {self.supersampling}: must be from 1 to 8")
        if not all(-360 <= azimuth <= 360 for azimuth in self.azimuths):
            raise OptionError(
                f"`view.azimuths` {' '.join(map(str, self.azimuths))}: must be -360 to 360 degrees"
            )
        if not 0 <= self.elevation <= 90:
            raise OptionError(f"`view.elevation` {self.elevation}: must be 0 to 90 degrees")
        if not 0 < self.step < inf:
            raise OptionError(f"`view.step` {self.step}: must be positive")
        if not 0 < self.cell_opacity < 1:
            raise OptionError(f"`view.cell_opacity` {self.cell_opacity}: must be between 0 and 1")
        if self.gamma is not None and not 0 < self.gamma < inf:
            raise OptionError(f"`view.gamma` {self.gamma}: must be positive")
        if not 0 < self.thinnest <= 1:
            raise OptionError(f"`view.thinnest` {self.thinnest}: must be above 0, at most 1")


@dataclass(frozen=True)
class SmokeConfig(TrainingConfig):
    """How a rule is trained on smoke."""

    motion: MotionConfig = field(default_factory=MotionConfig)
    """What the seen motion is compared with."""
    view: ViewConfig = field(default_factory=ViewConfig)
    """How the smoke is looked at."""
    texture: float = 0.0
    """Iterations on a solid texture of the picture for each one on the smoke, made before those:
    patterns come from there. 0 begins with nothing."""
    mass: float = 0.0
    """Weight of the squared change of the whole mass of the smoke by its Δd; 0 leaves it out."""
    augment: bool = False
    """Condition each state of the pool on another speed and density of the smoke, and for every
    other turn the velocity and add one that all cells share: the rule learns from one frame to
    paint smoke that moves otherwise."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.texture <= 1000:
            raise OptionError(f"`texture` {self.texture:g}: must be from 0 to 1000")
        if not 0 <= self.mass < inf:
            raise OptionError(f"`mass` {self.mass}: must not be negative")
        if self.rule.transport and self.motion.weight:
            raise OptionError(
                f"`motion.weight` {self.motion.weight:g}: the velocity carries the pattern of a "
                "rule with `transport`, which must not move it as well; leave one of them out"
            )

    @property
    def pictures(self) -> Pictures:
        """A view in each iteration."""
        return Pictures("view.size", self.view.size, 1)


@dataclass(frozen=True)
class SliceConfig:
    """How the block is looked at while training."""

    size: int = 128
    """Rows and columns of a slice, pixels."""
    pixels_per_cell: float = 4.0
    """Pixels that show a cell, but for the zoom."""
    supersampling: int = 2
    """Samples along the rows and the columns of a pixel: what is finer than pixels is averaged
    instead of becoming grain."""
    count: int = 1
    """Slices in an iteration."""
    oblique: float = 0.5
    """Share of the slices that lie at any angle; the others lie along the axes."""
    zoom: float = 1.1
    """A slice shows from 1/zoom to zoom times as much."""
    mesh: float = 0.5
    """Share of the pictures that show the mesh, where there is one."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise OptionError(f"`slice.size` {self.size}: at least 32 pixels are needed")
        if not 0 < self.pixels_per_cell <= 64:
            raise OptionError(
                f"`slice.pixels_per_cell` {self.pixels_per_cell:g}: must be above 0, at most 64"
            )
        if not 1 <= self.supersampling <= 8:
            raise OptionError(f"`slice.supersampling` {self.supersampling}: must be from 1 to 8")
        if self.count < 1:
            raise OptionError(f"`slice.count` {self.count}: at least 1 is needed")
        for name in ("oblique", "mesh"):
            if not 0 <= getattr(self, name) <= 1:
                raise OptionError(f"`slice.{name}` {getattr(self, name)}: must be from 0 to 1")
        if not 1 <= self.zoom <= 4:
            raise OptionError(f"`slice.zoom` {self.zoom}: must be from 1 to 4")

    @property
    def cells(self) -> float:
        """Along the side of a slice."""
        return self.size / self.pixels_per_cell


# A texture is the same everywhere and follows nothing. Only gradients tell a cell where in a
# pattern it is: they are perceived four times as strongly as in smoke.
_PLAIN = RuleConfig(
    sobel_divisor=8, position_prior=False, density_prior=False, velocity_prior=False
)
# No density is to be shaped by a picture in grey.
_COLOURS = AppearanceConfig(grey=False, samples=512)


@dataclass(frozen=True)
class TextureConfig(TrainingConfig):
    """How a rule for a texture is trained, solid or flat."""

    dimensions: Literal[2, 3] = 3
    """3 for a solid texture, which meshes are carved out of; 2 for a flat one, of which the picture
    itself is seen, and which may move."""
    rule: RuleConfig = _PLAIN
    """The shape of the rule."""
    appearance: AppearanceConfig = _COLOURS
    """What is compared with the picture."""
    pool: PoolConfig = field(default_factory=lambda: PoolConfig(size=16))
    """The states that rollouts start from."""
    iterations: int = 1500
    """Iterations of training: patterns come late, colours early."""
    learning_rate: float = 2e-3
    """Adam's learning rate at its highest. Nothing from outside holds a texture's states: at the
    rates that suit smoke, many explode."""
    slice: SliceConfig = field(default_factory=SliceConfig)
    """How the block is looked at."""
    block: int = 32
    """Cells along an edge of the block that is trained on; patterns are smaller than it."""
    motion: MotionConfig = field(default_factory=MotionConfig)
    """Of a flat texture with a motion field: what the seen motion is compared with."""
    motion_speed: float = 0.5
    """Cells a frame by which a flat texture moves where its motion field is fastest."""

    def __post_init__(self) -> None:
        super().__post_init__()
        rule = self.rule
        if (
            rule.position_prior
            or rule.density_prior
            or (rule.velocity_prior and self.dimensions == 3)
        ):
            raise OptionError(
                "`position_prior`, `density_prior`, `velocity_prior`: a texture has none"
            )
        if not 0 < self.motion_speed < inf:
            raise OptionError(f"`motion_speed` {self.motion_speed}: must be positive")
        if self.appearance.shows_density:
            raise OptionError("`appearance.grey_source` density: a texture has no density")
        if not SMALLEST <= self.block <= LARGEST:
            raise OptionError(f"`block` {self.block}: must be from {SMALLEST} to {LARGEST} cells")

    @property
    def pictures(self) -> Pictures:
        """Slices, or views of the mesh."""
        return Pictures("slice.size", self.slice.size, self.slice.count)
