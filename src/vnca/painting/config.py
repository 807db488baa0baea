"""How a rule is rolled over a sequence."""

from dataclasses import dataclass

from vnca.core.errors import OptionError
from vnca.engine.domain import DomainKind


@dataclass(frozen=True)
class StylizeConfig:
    """How a rule is rolled over a sequence, and how strongly it shows."""

    steps_per_frame: int | None = None
    """Steps of the automaton between two frames; as many as in training unless given. On a grid K
    times as fine they are K times as many, given or not."""
    warmup: int = 64
    """Steps on the first frame before it is painted."""
    domain: DomainKind | None = None
    """Which cells are active: those near the smoke (active) or all of its box; as in training
    unless given."""
    strength: float = 1.0
    """Colour of the painting, from 0 (white smoke) to 1."""
    density_strength: float = 1.0
    """How much the painting changes the density, from 0 (not at all) to 1."""
    seed: int = 0
    """Same seed, same machine, same painting."""

    def __post_init__(self) -> None:
        if self.warmup < 0 or (self.steps_per_frame is not None and self.steps_per_frame < 0):
            raise OptionError("`steps_per_frame` and `warmup` must not be negative")
        for name in ("strength", "density_strength"):
            if not 0 <= getattr(self, name) <= 1:
                raise OptionError(f"`{name}` {getattr(self, name)}: must be from 0 to 1")
