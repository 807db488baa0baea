"""Every hyperparameter of training on smoke, with its presets."""

import dataclasses
from dataclasses import dataclass, field
from math import inf
from typing import Literal

from vnca.automaton.rule import RuleConfig
from vnca.errors import OptionError
from vnca.losses.appearance import AppearanceConfig
from vnca.losses.motion import MotionConfig
from vnca.training.course import CourseConfig, Pictures, PoolConfig


@dataclass(frozen=True)
class ViewConfig:
    """How the smoke is looked at while training."""

    size: int = 128
    """Rows and columns of a view, pixels."""
    azimuths: tuple[float, ...] = ()
    """Views come from these degrees around the smoke; from all around unless given."""
    elevation: float = 30.0
    """Views come from up to this many degrees above or below the horizon."""
    step: float = 1.0
    """Distance between samples along a ray, cells."""
    mode: Literal["sane", "paper"] = "sane"
    """Integrand: emission and absorption, or the paper's as printed."""
    cell_opacity: float = 0.95
    """Without a given gamma, one is chosen that makes a typical cell this opaque: high shows the
    texture of the surface, low mixes many cells along a ray. For the paper's integrand it is chosen
    so that typical smoke is as bright as its colour."""
    gamma: float | None = None
    """Extinction of density 1, per cell; chosen from the frame unless given."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise OptionError(f"--view.size {self.size}: at least 32 pixels are needed")
        if not all(-360 <= azimuth <= 360 for azimuth in self.azimuths):
            raise OptionError(
                f"--view.azimuths {' '.join(map(str, self.azimuths))}: must be -360 to 360 degrees"
            )
        if not 0 <= self.elevation <= 90:
            raise OptionError(f"--view.elevation {self.elevation}: must be 0 to 90 degrees")
        if not 0 < self.step < inf:
            raise OptionError(f"--view.step {self.step}: must be positive")
        if not 0 < self.cell_opacity < 1:
            raise OptionError(f"--view.cell-opacity {self.cell_opacity}: must be between 0 and 1")
        if self.gamma is not None and not 0 < self.gamma < inf:
            raise OptionError(f"--view.gamma {self.gamma}: must be positive")


@dataclass(frozen=True)
class TrainConfig(CourseConfig):
    """How a rule is trained on smoke."""

    motion: MotionConfig = field(default_factory=MotionConfig)
    view: ViewConfig = field(default_factory=ViewConfig)
    winds: bool = False
    """Tell each state of the pool another speed and density of the smoke, and for every other turn
    the velocity and carry all of the smoke along: the rule learns from one frame to paint smoke
    that moves otherwise."""

    @property
    def pictures(self) -> Pictures:
        """A view in each iteration."""
        return Pictures("view.size", self.view.size, 1)


# A cell that knows where it is paints one frame well; one that does not paints any. Strong
# gradients let patterns hold their shape.
_ANYWHERE = RuleConfig(sobel_divisor=8, position_prior=False)

# About a pixel a cell: of finer detail comes grain.
_DRAFT = TrainConfig(
    iterations=250,
    learning_rate=1e-3,
    view=ViewConfig(size=96),
    pool=PoolConfig(size=16),
    rule=_ANYWHERE,
    appearance=AppearanceConfig(grey=False, samples=512),
    motion=MotionConfig(weight=0.3),
)

PRESETS = {
    "draft": _DRAFT,
    "standard": dataclasses.replace(
        _DRAFT,
        iterations=1000,
        learning_rate=1.5e-3,
        rule=dataclasses.replace(_ANYWHERE, hidden=128),
        winds=True,
    ),
    "paper": TrainConfig(
        iterations=5000,
        learning_rate=1e-3,
        shortest_rollout=32,
        longest_rollout=96,
        view=ViewConfig(size=256, elevation=0.0, mode="paper"),
        pool=PoolConfig(size=256),
        rule=RuleConfig(hidden=128),
        appearance=AppearanceConfig(pixels=0.0, style_scale=1.0),
        features="vgg16",
    ),
}
"""Training on smoke by name, for rules that begin with a texture: `draft` in minutes on two cores,
`standard` overnight or on a GPU; and `paper`, as the paper describes it, from nothing."""
