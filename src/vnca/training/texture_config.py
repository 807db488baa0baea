"""Every hyperparameter of training a solid texture."""

from dataclasses import dataclass, field

from vnca.core.errors import OptionError
from vnca.losses.appearance import AppearanceConfig
from vnca.painting.block import LARGEST, SMALLEST
from vnca.rule.rule import RuleConfig
from vnca.training.config import Pictures, PoolConfig, TrainingConfig


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
    """How a rule for a solid texture is trained."""

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

    def __post_init__(self) -> None:
        super().__post_init__()
        rule = self.rule
        if rule.position_prior or rule.density_prior or rule.velocity_prior:
            raise OptionError(
                "`position_prior`, `density_prior`, `velocity_prior`: a solid texture has none"
            )
        if self.appearance.shows_density:
            raise OptionError("`appearance.grey_source` density: a solid texture has no density")
        if not SMALLEST <= self.block <= LARGEST:
            raise OptionError(f"`block` {self.block}: must be from {SMALLEST} to {LARGEST} cells")

    @property
    def pictures(self) -> Pictures:
        """Slices, or views of the mesh."""
        return Pictures("slice.size", self.slice.size, self.slice.count)
