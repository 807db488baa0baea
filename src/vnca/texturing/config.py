"""Every hyperparameter of training a solid texture, with its presets."""

import dataclasses
from dataclasses import dataclass, field
from typing import Annotated

import tyro

from vnca.automaton.rule import RuleConfig
from vnca.errors import OptionError
from vnca.losses.appearance import AppearanceConfig
from vnca.texturing.block import LARGEST, SMALLEST
from vnca.training.course import CourseConfig, Pictures, PoolConfig


@dataclass(frozen=True)
class SliceConfig:
    """How the block is looked at while training."""

    size: int = 64
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


# A texture is the same everywhere and follows nothing. Only gradients tell a cell where in a
# pattern it is: they are perceived four times as strongly as in smoke.
_PLAIN = RuleConfig(
    sobel_divisor=8, position_prior=False, density_prior=False, velocity_prior=False
)
# No density is to be shaped by a picture in grey.
_COLOURS = AppearanceConfig(grey=False, samples=512)


@dataclass(frozen=True)
class TextureConfig(CourseConfig):
    """How a rule for a solid texture is trained."""

    rule: Annotated[RuleConfig, tyro.conf.arg(name="")] = _PLAIN
    appearance: AppearanceConfig = _COLOURS
    pool: PoolConfig = field(default_factory=lambda: PoolConfig(size=16))
    iterations: int = 1500
    """Iterations of training: patterns come late, colours early."""
    learning_rate: float = 2e-3
    """Adam's learning rate at its highest. Nothing from outside holds a texture's states: at the
    rates that suit smoke, many explode."""
    slices: Annotated[SliceConfig, tyro.conf.arg(name="slice")] = field(default_factory=SliceConfig)
    block: int = 32
    """Cells along an edge of the block that is trained on; patterns are smaller than it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        rule = self.rule
        if rule.position_prior or rule.density_prior or rule.velocity_prior:
            raise OptionError(
                "--position-prior, --density-prior, --velocity-prior: a solid texture has none"
            )
        if self.appearance.shows_density:
            raise OptionError("--appearance.grey-source density: a solid texture has no density")
        if not SMALLEST <= self.block <= LARGEST:
            raise OptionError(f"--block {self.block}: must be from {SMALLEST} to {LARGEST} cells")

    @property
    def pictures(self) -> Pictures:
        """Slices, or views of the mesh."""
        return Pictures("slice.size", self.slices.size, self.slices.count)


PRESETS = {
    "draft": TextureConfig(),
    "standard": TextureConfig(
        rule=dataclasses.replace(_PLAIN, hidden=128),
        slices=SliceConfig(size=128),
        pool=PoolConfig(size=64),
        block=64,
        iterations=6000,
        shortest_rollout=12,
        longest_rollout=48,
    ),
}
"""Training by name: `draft` in minutes on two cores, `standard` in hours or on a GPU."""
