"""How near a view of the smoke comes to the style picture, by measures training never used.

Nothing here is learned: colours, filters drawn at random once and for all, and spectra.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from vnca.core import AnyArray, BoolArray, FloatArray
from vnca.core.errors import OptionError, ShapeError
from vnca.io.picture import resize

FILTERS = 48
FILTER_SIZE = 7
LEVELS = 3
"""Sizes at which texture is compared, each half the one before."""
SLICES = 64
"""Directions in which colours, and responses of filters, are compared."""
WINDOW = 32
"""Rows and columns of the windows whose spectrum is taken, pixels."""
SMALLEST = 2 * WINDOW
"""Shorter side of a picture that is large enough to compare with, pixels."""
FEWEST = 32
"""Positions of a level without which it says nothing about texture."""

_QUANTILES = 256
_STRIDE = 8
_COVERED = 0.9
# Variance of the weakest direction of texture that counts in full, relative to the strongest.
_WEAKEST = 0.01
_SEED = 0

# Linear sRGB to the responses of cones, and their cube roots to lightness and two opponents.
_CONES = (
    (0.4122214708, 0.5363325363, 0.0514459929),
    (0.2119034982, 0.6806995451, 0.1073969566),
    (0.0883024619, 0.2817188376, 0.6299787005),
)
_OPPONENTS = (
    (0.2104542553, 0.7936177850, -0.0040720468),
    (1.9779984951, -2.4285922050, 0.4505937099),
    (0.0259040371, 0.7827717662, -0.8086757660),
)
# Distances of hue and chroma look about twice as large as OKLab has them.
_CHROMA = (1.0, 2.0, 2.0)


class StyleDistances(NamedTuple):
    """How far pixels are from the style picture, in units of its own variation.

    What is flat and of its mean colour is about one from it by each measure: they add up.
    """

    palette: float
    """Sliced Wasserstein distance of the colours."""
    texture: float
    """Sliced Wasserstein distance of what random filters see, mean over sizes."""
    spectrum: float
    """Difference of the radial amplitude spectra, relative to the picture's."""


def mean_distances(distances: Iterable[StyleDistances]) -> StyleDistances:
    """Their mean, measure by measure."""
    palette, texture, spectrum = np.mean(list(distances), axis=0).tolist()
    return StyleDistances(palette, texture, spectrum)


def normalised_score(
    painted: Sequence[float], plain: Sequence[float], cutout: Sequence[float]
) -> float:
    """1 − Σ (painted − cutout)₊ / Σ (plain − cutout)₊: the share of the way to the picture.

    1 for what is as near to the picture as its own parts are, by every measure; 0 for smoke as it
    comes; negative for what is farther away than that. What is nearer than the picture's own
    parts are, because it shows more of the palette than any of them, makes up for nothing.

    Args:
        painted: Distances of the painted smoke from the picture, an entry for each measure.
        plain: Those of the same smoke as it comes.
        cutout: Those of parts of the picture, cut out in the shape of the smoke.
    """
    left, gap = (
        sum(max(far - near, 0.0) for far, near in zip(distances, cutout, strict=True))
        for distances in (painted, plain)
    )
    return 1 - left / gap if gap > 0 else float(left == 0)


class StyleMetric:
    """Measures how far pictures are from one style picture.

    Attributes:
        picture: The style picture at the size of its comparison, linear RGB `[r, c, 3]`.
        background: Its mean colour, linear RGB `[3]`, to lay smoke over that is not quite opaque.

    Reference: Rabin et al. 2011 (sliced Wasserstein distance); Ustyuzhaninov et al. 2016
    (texture by random filters); Ottosson 2020 (OKLab).
    """

    def __init__(self, picture: FloatArray, shorter: int) -> None:
        """Prepare the picture.

        Args:
            picture: Linear RGB `[r, c, 3]`.
            shorter: Its shorter side where it is compared, pixels: as many cells as in the
                training.

        Raises:
            ShapeError: If it is not `[r, c, 3]`.
            OptionError: If it would be too small to tell its texture.
        """
        if picture.ndim != 3 or picture.shape[2] != 3:
            raise ShapeError(f"style picture: expected [r, c, 3], got {picture.shape}")
        if shorter < SMALLEST:
            raise OptionError(f"style picture: {shorter} pixels are too few, take {SMALLEST}")
        rows, columns = picture.shape[:2]
        factor = shorter / min(rows, columns)
        self.picture = resize(picture, round(rows * factor), round(columns * factor)).clip(0, 1)
        self.background = self.picture.mean((0, 1))
        random = np.random.default_rng(_SEED)
        self._hues = directions(random, 3, SLICES)
        colours = perceived(self.picture)
        everywhere = np.ones(self.picture.shape[:2], dtype=bool)
        self._palette = _Distribution.of(colours[everywhere] @ self._hues)
        self._textures = [
            _Texture.of(_filtered(maps, inside, filters), filters, random)
            for maps, inside in _levels(colours, everywhere)
            for filters in [_filters(random)]
        ]
        self._spectrum = _spectrum(colours, everywhere)

    def distances(self, picture: FloatArray, where: BoolArray) -> StyleDistances:
        """How far the chosen pixels of a picture are from the style picture.

        What a filter sees that also sees other pixels is left out; a size in which too little
        remains, too.

        Args:
            picture: Linear RGB `[r, c, 3]`.
            where: `[r, c]`, some of them true.
        """
        colours = perceived(picture)
        textures = [
            texture.distribution.distance(values)
            for texture, (maps, inside) in zip(self._textures, _levels(colours, where), strict=True)
            if len(values := _filtered(maps, inside, texture.filters)) >= FEWEST
        ]
        spectrum = _spectrum(colours, where)
        return StyleDistances(
            palette=self._palette.distance(colours[where] @ self._hues),
            texture=float(np.mean(textures)) if textures else 0.0,
            spectrum=float(np.abs(spectrum - self._spectrum).sum() / self._spectrum.sum()),
        )

    def cutouts(
        self, where: BoolArray, count: int, seed: int = 0
    ) -> Iterator[tuple[FloatArray, BoolArray]]:
        """Parts of the style picture in the shape of the chosen pixels, somewhere in it.

        Each comes as a picture and the pixels of it that belong to the shape. What of the shape
        is larger than the picture is left out.
        """
        random = np.random.default_rng(seed)
        at = np.argwhere(where)
        (top, left), (bottom, right) = at.min(0), at.max(0) + 1
        shape = where[top:bottom, left:right]
        room = self.picture.shape[:2]
        for _ in range(count):
            mask = shape[:, ::-1] if random.random() < 0.5 else shape
            beyond = np.subtract(mask.shape, room)
            y, x = random.integers(0, np.maximum(beyond, 0) + 1)
            mask = mask[y : y + room[0], x : x + room[1]]
            y, x = random.integers(0, np.maximum(-beyond, 0) + 1)
            rows, columns = mask.shape
            if mask.any():
                yield self.picture[y : y + rows, x : x + columns], mask


class _Distribution(NamedTuple):
    """Values along each direction in ascending order, and how widely they are spread."""

    quantiles: AnyArray
    spread: float

    @classmethod
    def of(cls, values: AnyArray) -> "_Distribution":
        return cls(_quantiles(values), float(np.abs(values - values.mean(0)).mean()) or 1.0)

    def distance(self, values: AnyArray) -> float:
        """Mean over the directions of the earth mover's distance, in units of the spread."""
        return float(np.abs(_quantiles(values) - self.quantiles).mean()) / self.spread


class _Texture(NamedTuple):
    """What filters of one size see in the style picture."""

    filters: Tensor
    distribution: _Distribution

    @classmethod
    def of(cls, seen: AnyArray, filters: Tensor, random: np.random.Generator) -> "_Texture":
        """Of what random filters see, `[n, FILTERS]`.

        They are mixed at random so that the responses to the picture are as strong in all
        directions: otherwise slow changes of brightness would drown all finer texture.
        """
        strengths, axes = np.linalg.eigh(np.atleast_2d(np.cov(seen.T)))
        floor = _WEAKEST * strengths[-1] or 1.0
        mix = axes / np.sqrt(strengths + floor) @ directions(random, FILTERS, SLICES)
        mixed = torch.einsum("fs,fcij->scij", torch.from_numpy(mix.astype(np.float32)), filters)
        return cls(mixed, _Distribution.of(seen @ mix))


def perceived(linear: AnyArray) -> AnyArray:
    """Linear RGB `[..., 3]` as lightness and two opponents, in which equal distances look alike.

    Reference: Ottosson 2020 (OKLab), with the scale of ΔE OK2 in CSS Color 4.
    """
    cones = np.clip(linear, 0, None) @ np.array(_CONES, np.float32).T
    return np.cbrt(cones) @ (np.array(_OPPONENTS, np.float32).T * np.array(_CHROMA, np.float32))


def _levels(colours: AnyArray, where: BoolArray) -> Iterator[tuple[Tensor, Tensor]]:
    """A picture `[1, 3, r, c]` and its chosen pixels `[1, 1, r, c]`, each half as large."""
    maps = torch.from_numpy(np.ascontiguousarray(colours.transpose(2, 0, 1), np.float32))[None]
    inside = torch.from_numpy(where.astype(np.float32))[None, None]
    yield maps, inside
    for _ in range(1, LEVELS):
        maps, inside = functional.avg_pool2d(maps, 2), -functional.max_pool2d(-inside, 2)
        yield maps, inside


@torch.no_grad()
def _filtered(maps: Tensor, inside: Tensor, filters: Tensor) -> AnyArray:
    """Responses `[n, filters]` where a filter sees nothing but chosen pixels."""
    if min(maps.shape[2:]) < FILTER_SIZE:
        return np.zeros((0, len(filters)), np.float32)
    seen = -functional.max_pool2d(-inside, FILTER_SIZE, stride=1)[0, 0] > 0.5
    return functional.conv2d(maps, filters)[0, :, seen].numpy().T


def _quantiles(values: AnyArray) -> AnyArray:
    ordered = np.sort(values, axis=0)
    at = (np.arange(_QUANTILES) + 0.5) / _QUANTILES * len(ordered) - 0.5
    lower = np.clip(np.floor(at), 0, len(ordered) - 1).astype(int)
    upper = np.minimum(lower + 1, len(ordered) - 1)
    part = np.clip(at - lower, 0, 1)[:, None]
    return ordered[lower] * (1 - part) + ordered[upper] * part


def _spectrum(colours: AnyArray, where: BoolArray) -> AnyArray:
    """Mean amplitude of the waves in windows of a picture, an entry for each frequency.

    Windows lie in the chosen pixels, or almost; what does not has their mean colour.
    """
    size = WINDOW
    pad = [(0, max(0, size - side)) for side in where.shape]
    where = np.pad(where, pad)
    colours = np.pad(colours, [*pad, (0, 0)])
    hann = np.hanning(size + 2)[1:-1]
    window = np.outer(hann, hann).astype(np.float32)
    window /= window.sum()
    views = np.lib.stride_tricks.sliding_window_view
    masks = views(where, (size, size))[::_STRIDE, ::_STRIDE].reshape(-1, size, size)
    tiles = views(colours, (size, size), (0, 1))[::_STRIDE, ::_STRIDE]
    tiles = tiles.reshape(-1, 3, size, size)
    covered = (masks * window).sum((1, 2))
    chosen = covered >= min(_COVERED, covered.max())
    weight = (masks[chosen] * window)[:, None]
    mean = (tiles[chosen] * weight).sum((2, 3), keepdims=True) / weight.sum((2, 3), keepdims=True)
    waves = np.fft.rfft2((tiles[chosen] - mean) * weight)
    power = np.square(np.abs(waves)).sum(1).mean(0)
    rows, columns = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)
    frequency = np.rint(np.hypot(rows, columns) * size).astype(int)
    inside = (frequency >= 1) & (frequency <= size // 2)
    total = np.bincount(frequency[inside], power[inside])[1:]
    return np.sqrt(total / np.bincount(frequency[inside])[1:])


def _filters(random: np.random.Generator) -> Tensor:
    """Random filters that see no flat colour, `[FILTERS, 3, FILTER_SIZE, FILTER_SIZE]`."""
    filters = random.standard_normal((FILTERS, 3, FILTER_SIZE, FILTER_SIZE))
    filters -= filters.mean((2, 3), keepdims=True)
    return torch.from_numpy(filters.astype(np.float32) / FILTER_SIZE)


def directions(random: np.random.Generator, size: int, count: int) -> FloatArray:
    """Unit vectors in columns, `[size, count]`."""
    drawn = random.standard_normal((size, count))
    return (drawn / np.linalg.norm(drawn, axis=0)).astype(np.float32)
