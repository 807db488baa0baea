"""Other methods of stylising smoke, to be compared with: what they are given, and each by its name.

They change density only, and write the same painted sequences as vnca does. What each published
code gets wrong is mended and named beside it; where that changes results, `as_published` brings it
back.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import ClassVar, Literal, TypeAlias

from jaxtyping import Float
from torch import Tensor

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.features import FeatureNetwork

Name: TypeAlias = Literal["aurand", "aurand-forward", "lnst", "tnst"]
PUBLISHED_HEIGHT = 300
"""Cells along the height of the smoke that the methods were published with; γ was chosen for it."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A sequence of smoke as the methods see it.

    Attributes:
        density: Divided by the density that counts as 1, non-negative.
        velocity: Cells a frame, that which carries a frame to the next.
    """

    density: Float[Tensor, "t x y z"]
    velocity: Float[Tensor, "t x y z 3"]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells along each axis."""
        _, x, y, z = self.density.shape
        return x, y, z

    def gamma(self, published: float) -> float:
        """A published extinction, 1/cell, on cells as large as these are: smoke is as opaque."""
        return published * PUBLISHED_HEIGHT / self.shape[2]


@dataclass(frozen=True, eq=False)
class Look:
    """What smoke is to look like.

    Attributes:
        picture: Grey, `[r, c]` in 0–1 as perceived.
        network: What compares.
    """

    picture: FloatArray
    network: FeatureNetwork


Tell: TypeAlias = Callable[[int, int, float | None], None]
"""Is told how many of how many steps are done, and a loss."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What all methods have."""

    name: ClassVar[Name]
    published_gamma: ClassVar[float]
    """Extinction of density 1, 1/cell, at `PUBLISHED_HEIGHT`."""

    iterations: int = 20
    """Steps of the optimisation, in each octave if there are several."""
    gamma: float | None = None
    """Extinction of density 1 per cell of the method's pictures; scaled from the published one
    unless given."""
    enlarged: float = 2.0
    """How many times as large the network sees a picture of a pixel a cell."""
    whole_picture: bool = False
    """Show the picture as large as the smoke, as published, in the place of a size at which its
    strokes span three cells."""
    seed: int = 0
    """Same seed, same machine, same result."""

    def __post_init__(self) -> None:
        if self.iterations < 0:
            raise OptionError(f"`iterations` {self.iterations}: must not be negative")
        if self.gamma is not None and not self.gamma > 0:
            raise OptionError(f"`gamma` {self.gamma}: must be positive")
        if not 0.25 <= self.enlarged <= 8:
            raise OptionError(f"`enlarged` {self.enlarged}: expected 0.25 to 8")

    def gamma_on(self, clip: Clip) -> float:
        """The extinction that its pictures are rendered with."""
        return clip.gamma(self.published_gamma) if self.gamma is None else self.gamma


def require_at_least(settings: Settings, **least: float) -> None:
    """Refuse numbers that are too small.

    Raises:
        OptionError: If there is one.
    """
    for found in fields(settings):
        if found.name in least and not getattr(settings, found.name) >= least[found.name]:
            raise OptionError(
                f"`{found.name}` {getattr(settings, found.name)}: at least {least[found.name]:g} "
                "is needed"
            )
