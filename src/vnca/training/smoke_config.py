"""Every hyperparameter of training on smoke."""

from dataclasses import dataclass, field
from math import inf
from typing import Literal

from vnca.core.errors import OptionError
from vnca.losses.motion import MotionConfig
from vnca.training.config import Pictures, TrainingConfig


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
    winds: bool = False
    """Tell each state of the pool another speed and density of the smoke, and for every other turn
    the velocity and carry all of the smoke along: the rule learns from one frame to paint smoke
    that moves otherwise."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.texture <= 1000:
            raise OptionError(f"`texture` {self.texture:g}: must be from 0 to 1000")

    @property
    def pictures(self) -> Pictures:
        """A view in each iteration."""
        return Pictures("view.size", self.view.size, 1)
