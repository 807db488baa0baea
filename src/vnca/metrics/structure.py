"""Whether strokes are strokes: measures of structure, next to those of colour and texture.

An eye that compares a painting with a picture sees lines, how wide they are and which way they run,
whether they are bright on dark or dark on bright, large shapes, and whether what is in one place
could be in the picture. None of this is trained with, and nothing of it is learned.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import log2
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_laplace
from scipy.spatial import KDTree

from vnca.core import AnyArray, BoolArray, FloatArray
from vnca.features.strokes import distance_inside, find_ridges, structure_tensor
from vnca.metrics.setup import Pair
from vnca.metrics.style import StyleMetric, directions, normalised_score, perceived
from vnca.metrics.style_score import FEWEST_OPAQUE

BINS = 16
"""Directions that are told apart, in half a turn."""
PATCH = 7
"""Rows and columns of a patch, pixels."""

_SCALES = (1.0, 2.0, 4.0)  # blurs of the gradients, pixels
_AWAY = 2.0  # blurs between a gradient and what is not shown
_REGIONS = 8  # along the shorter side of the picture
_DIRECTIONS = 64  # in which regions are compared
_AXES = 20  # of patches: what they vary in most
_PATCHES, _ASKED = 8192, 2048  # of the picture, and of a view
_ROUNDING = 1e-9  # of the mean square of what has no contrast
_SEED = 0


class Structure(NamedTuple):
    """The lines of a picture.

    Attributes:
        lines: How much it is made of lines: 0 for what runs no way, 1 for parallel ones.
        width: Of its strokes, pixels; 0 if there are none.
        contrast: Positive if narrow marks are bright and what is between them dark, from -1 to 1.
        directions: How much of them runs each way, `[BINS]`, their sum 1.
    """

    lines: float
    width: float
    contrast: float
    directions: AnyArray


def structure(picture: FloatArray, where: BoolArray | None = None) -> Structure:
    """The lines in the chosen pixels of a picture, linear RGB `[r, c, 3]`.

    Reference: Förstner and Gülch 1987 (structure tensor); Di Zenzo 1986 (of a colour picture).
    """
    if where is None:
        where = np.ones(picture.shape[:2], dtype=bool)
    colours = perceived(picture)
    colours = np.where(where[..., None], colours, colours[where].mean(0))
    inside = distance_inside(where)
    lines, weights, directions = 0.0, 0.0, np.zeros(BINS)
    for blur in _SCALES:
        shown = inside > _AWAY * blur
        across, turned, total = structure_tensor(colours, shown, blur)
        agreement = np.hypot(across, turned)[shown]
        lines += float(agreement.sum())
        weights += float(total[shown].sum())
        # Strokes run across the gradient; both are the same after half a turn.
        angle = np.arctan2(turned, across)[shown] / 2 + np.pi / 2
        bins = np.floor(angle / np.pi * BINS).astype(int) % BINS
        directions += np.bincount(bins, agreement, BINS)
    return Structure(
        lines=lines / weights if weights > 0 else 0.0,
        width=find_ridges(colours[..., 0], where).mean_width,
        contrast=_contrast(colours[..., 0], inside),
        directions=directions / directions.sum() if directions.any() else np.full(BINS, 1 / BINS),
    )


@dataclass(frozen=True)
class Likeness:
    """How the structure of views differs from the picture's, mean over the views.

    Attributes:
        lines: More (or less) made of lines than the picture is.
        width: Octaves by which strokes are wider (or narrower).
        contrast: More (or less) bright on dark, from -2 to 2.
        direction: Share of the strokes that run another way, 0 to 1.
        regions: Normalised distance of colours in regions: 0 plain smoke, 1 the picture's parts.
        patches: The same of patches and their nearest ones.
    """

    lines: float
    width: float | None
    contrast: float
    direction: float
    regions: float | None
    patches: float


class StructureMetric:
    """Compares structure with that of one style picture.

    Reference: Simakov et al. 2008 (nearest patches both ways).
    """

    def __init__(self, metric: StyleMetric) -> None:
        """Prepare the picture of `metric`, as large as it is there."""
        self._metric, picture = metric, metric.picture
        random = np.random.default_rng(_SEED)
        self._side = max(4, min(picture.shape[:2]) // _REGIONS)
        everywhere = np.ones(picture.shape[:2], dtype=bool)
        colours = perceived(picture)
        self._mix = directions(random, 6, _DIRECTIONS)
        self._regions = self._in_regions(colours, everywhere)
        patches = _patches(colours, everywhere, _PATCHES, random)
        self._mean = patches.mean(0)
        axes = np.linalg.eigh(np.cov((patches - self._mean).T))[1]
        self._axes = axes[:, -_AXES:]
        self._patches = (patches - self._mean) @ self._axes
        self._tree = KDTree(self._patches)
        # Every other patch is asked of the rest. They overlap: parts of it could not be nearer.
        rest = self._patches[1::2]
        self._nearest = _apart(self._patches[::2][:_ASKED], rest, KDTree(rest))

    def likeness(self, pairs: Sequence[Pair]) -> Likeness | None:
        """Compare views of a frame; None where too little is opaque in all of them."""
        pairs = [pair for pair in pairs if pair.where.sum() >= FEWEST_OPAQUE]
        if not pairs:
            return None
        behind = self._metric.background
        painted = [(pair.painted.over(behind), pair.where) for pair in pairs]
        plain = [(pair.plain.over(behind), pair.where) for pair in pairs]
        parts = [
            part
            for seed, (_, where) in enumerate(painted)
            for part in self._metric.cutouts(where, 1, seed)
        ]
        found = [structure(*view) for view in painted]
        # Of parts of the picture, for narrow smoke shows fewer and shorter lines than all of it.
        ideal = [structure(*part) for part in parts]
        wide = [log2(one.width / other.width) for one, other in _both(found, ideal)]
        ways = np.mean([one.directions for one in ideal], axis=0)
        regions = [self._by_regions(views) for views in (painted, plain, parts)]
        return Likeness(
            lines=_mean(found, "lines") - _mean(ideal, "lines"),
            width=float(np.mean(wide)) if wide else None,
            contrast=_mean(found, "contrast") - _mean(ideal, "contrast"),
            direction=float(
                np.mean([np.abs(_smooth(one.directions - ways)).sum() / 2 for one in found])
            ),
            regions=None if None in regions else normalised_score(*([r] for r in regions)),  # pyright: ignore[reportArgumentType]
            patches=normalised_score(
                [self._by_patches(painted)], [self._by_patches(plain)], [self._nearest]
            ),
        )

    def _by_regions(self, views: Sequence[tuple[FloatArray, BoolArray]]) -> float | None:
        """Sliced Wasserstein distance of what `_in_regions` finds in the views."""
        found = np.concatenate([self._in_regions(perceived(p), where) for p, where in views])
        if len(found) < _REGIONS or len(self._regions) == 0:
            return None
        at = np.linspace(0, 1, 64)
        one, other = (np.quantile(some @ self._mix, at, axis=0) for some in (found, self._regions))
        return float(np.abs(one - other).mean())

    def _in_regions(self, colours: AnyArray, where: BoolArray) -> AnyArray:
        """Mean and deviation of the colours in squares that are shown whole, `[n, 6]`."""
        side = self._side
        if min(where.shape) < side:
            return np.zeros((0, 6))
        views = np.lib.stride_tricks.sliding_window_view
        step = max(1, side // 2)
        whole = views(where, (side, side))[::step, ::step].mean((2, 3)) > 0.9
        squares = views(colours, (side, side), (0, 1))[::step, ::step][whole]
        return np.concatenate([squares.mean((2, 3)), squares.std((2, 3))], axis=1)

    def _by_patches(self, views: Sequence[tuple[FloatArray, BoolArray]]) -> float:
        random = np.random.default_rng(_SEED)
        many = _ASKED // len(views)
        asked = [_patches(perceived(p), where, many, random) for p, where in views]
        return _apart((np.concatenate(asked) - self._mean) @ self._axes, self._patches, self._tree)


def _apart(asked: AnyArray, known: AnyArray, tree: KDTree) -> float:
    """Mean distance of patches to their nearest, both ways; `tree` is that of `known`."""
    if len(asked) == 0:
        return 0.0
    there, back = tree.query(asked)[0], KDTree(asked).query(known)[0]
    return float(np.mean(there) + np.mean(back))


def _contrast(lightness: AnyArray, inside: AnyArray) -> float:
    """Whether bright marks are narrower than dark ones, or the reverse.

    What is narrower stands out more strongly, and what lies between is as much in sum.
    """
    bright, dark = 0.0, 0.0
    lightness = lightness - lightness.mean()  # the filter does not quite ignore it
    for blur in _SCALES:
        strength = -gaussian_laplace(lightness, blur)[inside > _AWAY * blur]
        bright += float(np.square(strength[strength > 0]).sum()) * blur**4
        dark += float(np.square(strength[strength < 0]).sum()) * blur**4
    return (bright - dark) / (bright + dark) if bright + dark > _ROUNDING * inside.size else 0.0


def _patches(
    colours: AnyArray, where: BoolArray, count: int, random: np.random.Generator
) -> AnyArray:
    """Patches that are shown whole, at the full size and at half of it, `[n, 3 · PATCH²]`."""
    found = [np.zeros((0, 3 * PATCH**2), np.float32)]
    for maps, inside in _sizes(colours, where):
        if min(inside.shape) < PATCH:
            continue
        views = np.lib.stride_tricks.sliding_window_view
        at = np.argwhere(views(inside, (PATCH, PATCH)).all((2, 3)))
        at = at[random.permutation(len(at))[: count // 2]]
        patches = views(maps, (PATCH, PATCH), (0, 1))[at[:, 0], at[:, 1]]
        found.append(patches.reshape(len(at), 3 * PATCH**2))
    return np.concatenate(found)


def _sizes(colours: AnyArray, where: BoolArray) -> Iterator[tuple[AnyArray, BoolArray]]:
    yield colours, where
    rows, columns = (side // 2 * 2 for side in where.shape)
    inside = where[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2).all((1, 3))
    halved = colours[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2, 3).mean((1, 3))
    yield halved, np.asarray(inside, bool)


def _both(
    found: Sequence[Structure], ideal: Sequence[Structure]
) -> Iterator[tuple[Structure, Structure]]:
    """Those with strokes, each with what it is to be like."""
    yield from (pair for pair in zip(found, ideal, strict=False) if pair[0].width and pair[1].width)


def _mean(found: Sequence[Structure], name: str) -> float:
    return float(np.mean([getattr(one, name) for one in found])) if found else 0.0


def _smooth(directions: AnyArray) -> AnyArray:
    """Neighbouring directions are nearly the same."""
    return (np.roll(directions, 1) + 2 * directions + np.roll(directions, -1)) / 4
