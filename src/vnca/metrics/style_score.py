"""How much views of painted smoke, or slices of a solid texture, look like the style picture.

By measures that training never used, and in the eyes of frozen networks. One of these may be the
network that the rule was trained to please, so there are several, and each says whether it is the
one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import NamedTuple

import numpy as np
import torch

from vnca.core import AnyArray, BoolArray, Box, FloatArray
from vnca.core.colour import linear_to_srgb
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.engine import Compute
from vnca.features import SMALLEST, FeatureNetwork
from vnca.io.smoke_format import on_one_lattice
from vnca.losses.appearance import AppearanceConfig, AppearanceLoss
from vnca.metrics.setup import SIZE, Coloured, Pair, Setup, Viewpoint
from vnca.metrics.style import StyleDistances, StyleMetric, mean_distances, normalised_score
from vnca.painting import StylizeConfig, stylize
from vnca.rule import Rule
from vnca.training.scenes.texture import FAMILIES, as_picture, shown, slice_points

FEWEST_OPAQUE = 64
"""Opaque pixels without which a view says nothing about style."""
CUTOUTS = 3
"""Cut-outs of the picture for each view."""
SIDES = tuple(Viewpoint(azimuth, 10.0) for azimuth in (0.0, 90.0, 180.0, 270.0))
"""From where frames of a sequence are compared with the picture."""
_SEED = 0  # of the positions that judges compare, the same for all


@dataclass
class Judge:
    """A network that compares what is opaque in views with the style picture.

    Attributes:
        name: What it is called.
        trained_with: Whether the rule was trained with it; None if its file does not tell.
        reason: Why it cannot judge, if it cannot.
        shares: The normalised score, by frame.
    """

    name: str
    trained_with: bool | None
    reason: str = ""
    shares: dict[int, float] = field(default_factory=dict)
    _loss: AppearanceLoss | None = None

    @classmethod
    def of(
        cls, network: FeatureNetwork, trained_with: bool | None, metric: StyleMetric, size: int
    ) -> "Judge":
        """A judge of views.

        Args:
            network: What compares.
            trained_with: Whether the rule was trained with it.
            metric: Has the picture, as large as it is to be compared.
            size: Rows and columns of the views.
        """
        shorter = min(metric.picture.shape[:2])
        config = AppearanceConfig(pixels=0.0, grey=False, style_scale=shorter / size)
        loss = AppearanceLoss(network, metric.picture, config, size)
        return cls(network.name, trained_with, _loss=loss)

    def look(self, frame: int, pairs: Sequence[Pair], metric: StyleMetric) -> None:
        """Judge views of a frame, as `style_score` does by measures that never learned.

        A view counts as far as both ways of the smoke are opaque in it.
        """
        pairs = [pair for pair in pairs if pair.where.any()]
        if self._loss is None or not pairs:
            return
        behind = metric.background
        painted, plain, cutout = (
            float(np.mean([self._distance(*one) for one in some]))
            for some in (
                [(pair.painted.over(behind), pair.where) for pair in pairs],
                [(pair.plain.over(behind), pair.where) for pair in pairs],
                [
                    part
                    for seed, pair in enumerate(pairs)
                    for part in metric.cutouts(pair.where, 1, seed)
                ],
            )
        )
        self.shares[frame] = normalised_score([painted], [plain], [cutout])

    @torch.no_grad()
    def _distance(self, picture: AnyArray, where: BoolArray) -> float:
        """Styles and moments apart, summed over the layers."""
        assert self._loss is not None
        lacking = [(0, max(0, SMALLEST - side)) for side in where.shape]
        encoded = linear_to_srgb(np.pad(picture, [*lacking, (0, 0)]).clip(0, 1)).astype(np.float32)
        shown = torch.from_numpy(encoded).permute(2, 0, 1)[None]
        opacity = torch.from_numpy(np.pad(where, lacking).astype(np.float32))[None]
        # The same positions are drawn for all.
        return float(self._loss(shown, opacity, torch.Generator().manual_seed(_SEED)).total)


class SliceDistance(NamedTuple):
    """Mean over slices of one family.

    Attributes:
        total: The appearance loss.
        terms: Its parts, weighted.
    """

    total: float
    terms: dict[str, float]


def slice_distances(
    block: FloatArray, appearance: AppearanceLoss, *, size: int, count: int = 16, seed: int = 0
) -> dict[str, SliceDistance]:
    """Mean appearance loss of fixed slices of a block, family by family.

    The slices, and the positions compared in them, depend on nothing but the seed: blocks of
    any size and origin are asked the same. Those named `unseen` lie where training never looks.

    Args:
        block: Linear RGB `[s, s, s, 3]`.
        appearance: What judges; losses of different ones cannot be compared.
        size: Rows and columns of a slice, pixels of a cell each.
        count: Slices of a family.
        seed: Chooses them.
    """
    values = torch.from_numpy(np.ascontiguousarray(block)).to(appearance.background.device)
    found = {}
    for family, draw in FAMILIES.items():
        random = np.random.default_rng(seed)
        generator = torch.Generator().manual_seed(seed)
        losses = []
        for _ in range(count):
            middle = random.uniform(0, len(block), 3)
            points = slice_points(draw(random), middle, size=size).to(values.device)
            with torch.no_grad():
                colour = shown(values, points)
                losses.append(
                    appearance(as_picture(colour), torch.ones_like(colour[None, ..., 0]), generator)
                )
        terms = {
            name: float(np.mean([float(loss.terms[name]) for loss in losses]))
            for name in losses[0].terms
        }
        found[family] = SliceDistance(float(np.mean([float(loss.total) for loss in losses])), terms)
    return found


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
        return [normalised_score(distances, self.plain, self.cutout) for distances in self.painted]

    @property
    def normalised_score(self) -> float:
        """The normalised score, mean over the views."""
        return float(np.mean(self.shares))

    @property
    def spread(self) -> float:
        """Standard deviation of that share over the views, relative to its mean."""
        return float(np.std(self.shares) / max(abs(np.mean(self.shares)), 1e-6))

    @property
    def by_measure(self) -> dict[str, float]:
        """The normalised score by each measure alone, mean over the views."""
        return {
            name: float(
                np.mean(
                    [
                        normalised_score(
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


def score_style(metric: StyleMetric, pairs: Sequence[Pair]) -> StyleScore | None:
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
            parts.append(score_style(metric, pairs))
    return joined_style_score(parts)
