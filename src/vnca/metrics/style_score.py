"""How much the views of painted smoke look like the style picture."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from vnca.core.errors import GridError
from vnca.core.typing import Box, FloatArray
from vnca.core.volume import Volume
from vnca.engine.session import Compute
from vnca.io.orientation import on_one_lattice
from vnca.metrics.setup import SIZE, Coloured, Pair, Setup, Viewpoint
from vnca.metrics.style import StyleDistances, StyleMetric, gap_closed, mean_distances
from vnca.painting.config import StylizeConfig
from vnca.painting.roll import stylize
from vnca.rule.rule import Rule

FEWEST_OPAQUE = 64
"""Opaque pixels without which a view says nothing about style."""
CUTOUTS = 3
"""Cut-outs of the picture for each view."""
SIDES = tuple(Viewpoint(azimuth, 10.0) for azimuth in (0.0, 90.0, 180.0, 270.0))
"""From where frames of a sequence are compared with the picture."""


@dataclass(frozen=True, eq=False)
class StyleScore:
    """How far views are from the style picture, and what that is to be compared with.

    Attributes:
        viewpoints: Where each view was taken from.
        painted: The distance of each view of the painting.
        plain: The mean distance of the same smoke as it comes.
        cutout: The mean distance of parts of the picture in the shape of the smoke.
    """

    viewpoints: tuple[Viewpoint, ...]
    painted: tuple[StyleDistances, ...]
    plain: StyleDistances
    cutout: StyleDistances

    @property
    def shares(self) -> list[float]:
        """The share of the gap that each view closes, by all measures together."""
        return [gap_closed(distances, self.plain, self.cutout) for distances in self.painted]

    @property
    def gap_closed(self) -> float:
        """The share of the gap closed, mean over the views."""
        return float(np.mean(self.shares))

    @property
    def spread(self) -> float:
        """Standard deviation of that share over the views, relative to its mean."""
        return float(np.std(self.shares) / max(abs(np.mean(self.shares)), 1e-6))

    @property
    def by_measure(self) -> dict[str, float]:
        """The share of the gap closed by each measure alone, mean over the views."""
        return {
            name: float(
                np.mean(
                    [
                        gap_closed(
                            d[at : at + 1], self.plain[at : at + 1], self.cutout[at : at + 1]
                        )
                        for d in self.painted
                    ]
                )
            )
            for at, name in enumerate(StyleDistances._fields)
        }


def joined_style_score(parts: Iterable[StyleScore | None]) -> StyleScore:
    """That of the views of several frames, of which each has about as many.

    Raises:
        GridError: If no frame has one.
    """
    known = [part for part in parts if part is not None]
    if not known:
        raise GridError(
            "the smoke is opaque in no frame that was looked at, so that its style cannot be "
            "measured; choose others with `frames`"
        )
    return StyleScore(
        tuple(viewpoint for part in known for viewpoint in part.viewpoints),
        tuple(distances for part in known for distances in part.painted),
        mean_distances(part.plain for part in known),
        mean_distances(part.cutout for part in known),
    )


def style_score(metric: StyleMetric, pairs: Sequence[Pair]) -> StyleScore | None:
    """Compare views of a frame with the style picture where the smoke is opaque.

    None where it is opaque in none of them.
    """
    pairs = [pair for pair in pairs if pair.where.sum() >= FEWEST_OPAQUE]
    if not pairs:
        return None
    return StyleScore(
        tuple(pair.viewpoint for pair in pairs),
        tuple(metric.distances(p.painted.over(metric.background), p.where) for p in pairs),
        mean_distances(metric.distances(p.plain.over(metric.background), p.where) for p in pairs),
        mean_distances(
            metric.distances(*part)
            for seed, pair in enumerate(pairs)
            for part in metric.cutouts(pair.where, CUTOUTS, seed)
        ),
    )


def measure_style(
    rule: Rule,
    frames: Sequence[Volume],
    picture: FloatArray,
    *,
    cells: float,
    refine: int = 1,
    size: int = SIZE,
    every: int = 6,
    config: StylizeConfig | None = None,
    compute: Compute | None = None,
) -> StyleScore:
    """Paint a sequence and compare four sides of some of its frames with the style picture.

    Args:
        rule: What paints.
        frames: The sequence.
        picture: The style picture, linear RGB `[r, c, 3]`.
        cells: Shorter side of the picture as the rule was shown it, cells.
        refine: The painting's grid is so many times as fine as the smoke's.
        size: Rows and columns of the views.
        every: So many frames are painted for one that is looked at; the last one is.
        config: How the rule is applied.
        compute: How steps are computed.

    Raises:
        GridError: If there is no smoke, or none that is opaque.
    """
    frames = list(on_one_lattice(frames))
    box = reduce(Box.union, (smoke.box for smoke in frames), Box((0, 0, 0), (0, 0, 0)))
    setup = Setup.around(frames, rule, size).refined(refine)
    metric = StyleMetric(picture, round(cells * setup.scale))
    config = config or StylizeConfig()
    paintings = stylize(frames, rule, config, box=box, refine=refine, compute=compute)
    parts = []
    for at, painting in enumerate(paintings, 1):
        if (len(frames) - at) % every == 0:
            smoke = Coloured.painted(painting), Coloured.plain(painting.smoke)
            pairs = [setup.look_twice(*smoke, viewpoint) for viewpoint in SIDES]
            parts.append(style_score(metric, pairs))
    return joined_style_score(parts)
