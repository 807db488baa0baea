"""How much the views of painted smoke look like the style picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vnca.automaton.rule import Rule
from vnca.automaton.stepper import stepper
from vnca.errors import GridError
from vnca.evaluation.stage import Stage
from vnca.evaluation.style import StyleDistances, StyleGauge, gap_closed, mean_distances
from vnca.stylize.config import StylizeConfig
from vnca.stylize.roll import Painting, stylize
from vnca.typing import Box, FloatArray
from vnca.volume import Volume

OPAQUE = 0.8
"""Opacity from which smoke is compared with the picture."""
FEWEST_PIXELS = 64
"""Opaque pixels without which a view says nothing about style."""
CUTOUTS = 3
"""Cut-outs of the picture for each view."""


class Sight(NamedTuple):
    """Where smoke is looked at from, degrees."""

    azimuth: float
    elevation: float


SIDES = tuple(Sight(azimuth, 10.0) for azimuth in (0.0, 90.0, 180.0, 270.0))
RING = tuple(Sight(15.0 * turn, 10.0) for turn in range(24))
POLES = tuple(
    Sight(azimuth, elevation)
    for elevation in (60.0, -60.0)
    for azimuth in (0.0, 90.0, 180.0, 270.0)
)


@dataclass(frozen=True, eq=False)
class Likeness:
    """How far views are from the style picture, and what that is to be compared with.

    Attributes:
        sights: Where each view was taken from.
        painted: The distance of each view of the painting.
        plain: The mean distance of the same smoke in plain grey.
        cutout: The mean distance of parts of the picture in the shape of the smoke.
    """

    sights: tuple[Sight, ...]
    painted: tuple[StyleDistances, ...]
    plain: StyleDistances
    cutout: StyleDistances

    @property
    def shares(self) -> list[float]:
        """The share of the gap that each view closes, by all measures together."""
        return [gap_closed(d.total, self.plain.total, self.cutout.total) for d in self.painted]

    @property
    def gap_closed(self) -> float:
        """The share of the gap closed, mean over the views."""
        return float(np.mean(self.shares))

    @property
    def spread(self) -> float:
        """Standard deviation of that share over the views, relative to its mean."""
        return float(np.std(self.shares) / abs(np.mean(self.shares)))

    @property
    def by_measure(self) -> dict[str, float]:
        """The share of the gap closed by each measure alone."""
        ours = mean_distances(self.painted)
        return {
            name: gap_closed(
                getattr(ours, name), getattr(self.plain, name), getattr(self.cutout, name)
            )
            for name in StyleDistances._fields
        }

    @classmethod
    def joined(cls, parts: Sequence["Likeness"]) -> "Likeness":
        """That of all views of several frames; each frame has as many."""
        return cls(
            tuple(sight for part in parts for sight in part.sights),
            tuple(distances for part in parts for distances in part.painted),
            mean_distances(part.plain for part in parts),
            mean_distances(part.cutout for part in parts),
        )


def likeness(
    stage: Stage, gauge: StyleGauge, painting: Painting, sights: Sequence[Sight]
) -> Likeness:
    """Compare views of a painted frame with the style picture.

    Pixels count where the smoke is opaque, painted and unpainted.

    Raises:
        GridError: If it is opaque nowhere.
    """
    painted, plain, cutouts, seen = [], [], [], []
    for sight in sights:
        views = [
            stage.look(density, colour, painting.smoke.origin, *sight)
            for density, colour in (
                (painting.density, painting.colour),
                (painting.smoke.density, None),
            )
        ]
        where = np.logical_and(*((view.opacity > OPAQUE).numpy() for view in views))
        if where.sum() < FEWEST_PIXELS:
            continue
        ours, grey = (view.over(gauge.background.tolist()).numpy() for view in views)
        seen.append(sight)
        painted.append(gauge.distances(ours, where))
        plain.append(gauge.distances(grey, where))
        cutouts += [
            gauge.distances(*part) for part in gauge.cutouts(where, CUTOUTS, seed=len(seen))
        ]
    if not seen:
        raise GridError(
            f"frame {painting.smoke.frame}: its smoke is opaque nowhere, so its style cannot be "
            "measured; choose other frames"
        )
    return Likeness(tuple(seen), tuple(painted), mean_distances(plain), mean_distances(cutouts))


def measure_style(
    rule: Rule,
    frames: Sequence[Volume],
    picture: FloatArray,
    *,
    size: int = 192,
    style_scale: float = 1.0,
    every: int = 6,
    config: StylizeConfig | None = None,
    backend: str = "auto",
) -> Likeness:
    """Paint a sequence and compare four sides of some of its frames with the style picture.

    Args:
        rule: What paints.
        frames: The sequence.
        picture: The style picture, linear RGB `[r, c, 3]`.
        size: Rows and columns of the views.
        style_scale: Shorter side of the picture relative to the views, as in training.
        every: So many frames are painted for one that is looked at; the last one is.
        config: How the rule is applied.
        backend: What computes the automaton.

    Raises:
        GridError: If a frame's smoke is opaque nowhere.
    """
    box = Box((0, 0, 0), (0, 0, 0))
    for smoke in frames:
        box = box.union(smoke.box)
    stage, gauge = Stage.of(rule, box, size), StyleGauge(picture, round(size * style_scale))
    paintings = stylize(frames, rule, stepper(rule, backend), config or StylizeConfig(), box=box)
    left = reversed(range(len(frames)))
    return Likeness.joined(
        [
            likeness(stage, gauge, painting, SIDES)
            for painting, remaining in zip(paintings, left, strict=True)
            if remaining % every == 0
        ]
    )
