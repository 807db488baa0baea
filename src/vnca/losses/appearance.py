"""Does a picture of the smoke look painted like the style image?"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from vnca.core import FloatArray
from vnca.core.errors import OptionError, ShapeError
from vnca.features import FeatureNetwork
from vnca.features.strokes import picture_cells
from vnca.losses import (
    Moments,
    chosen_rows,
    luma,
    moment_distance,
    moments,
    ordered,
    palette_distance,
    sample_positions,
    sliced_distance,
    style_distance,
    to_yuv,
    unit_vectors,
)
from vnca.rendering.colour import linear_to_srgb

TERMS = ("style", "moments", "distribution", "pixels", "regions")
"""What an appearance is made of: each has a weight of its name."""
REGIONS = (16, 8, 4)
"""Squares along the side of a view, of each size at which colours of regions are compared."""
DIRECTIONS, SLICES = 128, 32
"""Along which distributions of the style image are known, and are compared at a time."""
MOST_SORTED = 1024
"""Vectors of a picture that are sorted: few quantiles of few are far off by chance."""


@dataclass(frozen=True)
class AppearanceConfig:
    """What is compared between a picture and the style image, and how strongly."""

    layers: tuple[str, ...] = ()
    """Layers of the network to compare: its own choice unless given. EfficientNet has stem and
    blockN, VGG reluB_I."""
    style: float = 1.0
    """Weight of style matching; 0 leaves it out."""
    moments: float = 1.0
    """Weight of the features' means and covariances; 0 leaves them out."""
    distribution: float = 0.0
    """Weight of the distribution of the features, by the sliced Wasserstein distance, which sees
    more of it than means and covariances do; 0 leaves it out."""
    pixels: float = 5.0
    """Weight of the palette, the picture itself as layer zero; 0 leaves it out."""
    regions: float = 0.0
    """Weight of the shares that colours have in regions of three sizes, by the sliced Wasserstein
    distance: contrast in large shapes; 0 leaves it out."""
    colour: bool = True
    """Compare the pictures in colour."""
    grey: bool = True
    """Compare the pictures in grey, too."""
    grey_source: Literal["luma", "density"] = "luma"
    """What is seen in grey: the luma of the coloured view, which colour alone can satisfy, or as in
    the paper the density, I = Σ d τ, which nothing but a change of the density can."""
    samples: int = 1024
    """Positions drawn in each layer for style matching, from either picture."""
    style_scale: float | None = None
    """Shorter side of the style image relative to the view: below 1 shrinks the brush strokes.
    Chosen by the strokes of the picture unless given: they span three cells, two where a decoder
    draws them, and four pixels at least."""
    opacity_threshold: float = 0.6
    """Compare only where the smoke is at least this opaque."""

    def __post_init__(self) -> None:
        for name in TERMS:
            if getattr(self, name) < 0:
                raise OptionError(
                    f"`appearance.{name}` {getattr(self, name)}: must not be negative"
                )
        if not (self.colour or self.grey):
            raise OptionError("`appearance.colour`, `appearance.grey`: at least one is needed")
        if not any(getattr(self, name) for name in TERMS):
            names = ", ".join(f"`appearance.{name}`" for name in TERMS)
            raise OptionError(f"{names}: all are 0, nothing is compared")
        if self.samples < 1:
            raise OptionError(f"`appearance.samples` {self.samples}: must be at least 1")
        if not 0 <= self.opacity_threshold < 1:
            raise OptionError(
                f"`appearance.opacity_threshold` {self.opacity_threshold}: must be at least 0 "
                "and below 1"
            )
        if self.grey_source == "density" and not self.grey:
            raise OptionError(
                "`appearance.grey_source` density: nothing is compared in grey; "
                "add `appearance.grey`"
            )
        if self.style_scale is not None and not 0 < self.style_scale < inf:
            raise OptionError(f"`appearance.style_scale` {self.style_scale}: must be positive")

    @property
    def shows_density(self) -> bool:
        """Whether pictures of the density itself are compared."""
        return self.grey and self.grey_source == "density"


class Appearance(NamedTuple):
    """The appearance loss and its terms, weighted: they add up to the total."""

    total: Float[Tensor, ""]
    terms: dict[str, Float[Tensor, ""]]


class _Layer(NamedTuple):
    """What the style image shows in one layer."""

    features: Float[Tensor, "n c"]
    moments: Moments
    slices: "_Slices | None"
    scale: float


class _Region(NamedTuple):
    """Squares of some pixels along a side, and their mean colours in the style image."""

    side: int
    colours: "_Slices"


class _Slices(NamedTuple):
    """What is seen of the style image along directions, of which each comparison takes some."""

    directions: Float[Tensor, "c k"]
    quantiles: Float[Tensor, "q k"]

    @classmethod
    def of(cls, vectors: Tensor) -> "_Slices":
        generator = torch.Generator().manual_seed(0)
        directions = unit_vectors(vectors.shape[1], DIRECTIONS, generator).to(vectors)
        return cls(directions, ordered(vectors, directions, MOST_SORTED))

    def distance(self, vectors: Tensor, generator: torch.Generator) -> Tensor:
        some = torch.randperm(DIRECTIONS, generator=generator)[:SLICES].to(vectors.device)
        return sliced_distance(vectors, self.directions[:, some], self.quantiles[:, some])


class AppearanceLoss:
    """Distance between pictures and one style image, over several layers of a network.

    Each layer's features are divided by the root mean square of the style image's, in colour
    and in grey. Cosines do not notice; means and covariances, which the paper compares as
    they are, then weigh alike in all layers and for all networks. Unscaled, they differ by
    orders of magnitude: one takes input in ±2, another in ±128.

    Attributes:
        background: Mean colour of the style image, linear RGB `[3]`. Pictures are best
            composited over it, so that thin smoke does not read as black paint.
        style_scale: Shorter side of the style image relative to the views, given or chosen.

    Reference: the VNCA paper's L_app; Kolkin, Salavon and Shakhnarovich 2019; Heitz et al. 2021.
    """

    # Below this many positions a layer says little about texture: the most opaque are added.
    fewest_positions = 16
    # Thinner smoke shows too little of its colour to be compared.
    least_opacity = 0.05
    # Positions of the style image kept in each layer
    most_style_positions = 16384
    _seed = 0

    def __init__(
        self,
        network: FeatureNetwork,
        style_image: FloatArray,
        config: AppearanceConfig,
        size: int,
        cells: float | None = None,
        *,
        drawn: bool = False,
    ) -> None:
        """Prepare the style image.

        Args:
            network: Its device is the device of the loss.
            style_image: Linear RGB `[r, c, 3]`.
            config: What is compared.
            size: Shorter side of the views, pixels.
            cells: The same in cells, to choose the scale of the style image by; a cell a pixel
                unless given.
            drawn: Whether a decoder draws what is finer than cells.

        Raises:
            OptionError: If a layer does not exist.
            ShapeError: If the image is not `[r, c, 3]`.
        """
        if style_image.ndim != 3 or style_image.shape[2] != 3:
            raise ShapeError(f"style image: expected [r, c, 3], got {style_image.shape}")
        self.config = config
        self._network = network
        self.style_scale = config.style_scale or style_scale(style_image, size, cells, drawn=drawn)
        linear = torch.tensor(style_image, dtype=torch.float32, device=network.device)
        linear = linear.permute(2, 0, 1)[None]
        self.background = linear.mean((0, 2, 3))
        shorter = max(32, round(size * self.style_scale))
        self._generator = torch.Generator().manual_seed(self._seed)
        with torch.no_grad():
            picture = linear_to_srgb(_resized(linear, shorter).clamp(0, 1))
            self._pixels = self._kept(_positions(picture)[0])
            self._layers = [
                [self._described(maps) for maps in layer] for layer in self._features(picture)
            ]
            sides = [max(1, size // count) for count in REGIONS] if config.regions else []
            squares = {side: _positions(_squares(picture, side))[0] for side in sides}
            self._regions = [
                _Region(side, _Slices.of(to_yuv(colours)))
                for side, colours in squares.items()
                if len(colours) >= self.fewest_positions
            ]

    def __call__(
        self,
        picture: Float[Tensor, "b 3 r c"],
        opacity: Float[Tensor, "b r c"],
        generator: torch.Generator,
        grey: Float[Tensor, "b 3 r c"] | None = None,
    ) -> Appearance:
        """Mean over the pictures of the summed distances over the layers.

        Differentiable in `picture` and `grey`; `opacity` only chooses positions. A picture without
        smoke contributes zero.

        Args:
            picture: sRGB in 0–1.
            opacity: 0–1.
            generator: Draws the positions.
            grey: What is compared in grey, sRGB in 0–1 with equal channels; the luma of `picture`
                unless given.

        Raises:
            ShapeError: If picture, opacity and grey differ in size.
        """
        if grey is not None and grey.shape != picture.shape:
            raise ShapeError(
                f"grey: expected {tuple(picture.shape)} like the picture, got {tuple(grey.shape)}"
            )
        if opacity.shape != (picture.shape[0], *picture.shape[2:]):
            raise ShapeError(
                f"opacity: expected {(picture.shape[0], *picture.shape[2:])} to match the "
                f"picture, got {tuple(opacity.shape)}"
            )
        config = self.config
        # Keeps a picture without smoke part of the graph, with a gradient of zero.
        nothing = (picture * 0).sum()
        terms = dict.fromkeys(TERMS, nothing)
        for region in self._regions:
            squares = _squares(picture, region.side)
            for ours in self._shown(squares, self._chosen(opacity, squares)):
                # A few squares cannot have the colours of all of the picture.
                if len(ours) >= self.fewest_positions:
                    distance = self._apart(region.colours, to_yuv(ours), generator)
                    terms["regions"] = terms["regions"] + distance / len(self._regions)
        if config.pixels:
            for ours in self._shown(picture, self._chosen(opacity, picture)):
                palettes = palette_distance(
                    self._drawn(ours, generator), self._drawn(self._pixels, generator)
                )
                terms["pixels"] = terms["pixels"] + palettes
        if config.style or config.moments or config.distribution:
            for ours, style in self._compared(picture, grey, opacity):
                if config.moments:
                    distance = moment_distance(moments(ours), style.moments)
                    terms["moments"] = terms["moments"] + distance
                if style.slices is not None:
                    distance = self._apart(style.slices, ours, generator)
                    terms["distribution"] = terms["distribution"] + distance
                if config.style:
                    distance = style_distance(
                        self._drawn(ours, generator), self._drawn(style.features, generator)
                    )
                    terms["style"] = terms["style"] + distance
        weights = {name: getattr(config, name) / len(picture) for name in TERMS}
        terms = {name: value * weights[name] for name, value in terms.items() if weights[name]}
        total = torch.stack([nothing, *terms.values()]).sum()
        return Appearance(total, terms)

    def _compared(
        self, picture: Tensor, grey: Tensor | None, opacity: Tensor
    ) -> Iterator[tuple[Float[Tensor, "_ _"], _Layer]]:
        """Feature sets of the smoke, each with the style's counterpart."""
        for maps, styles in zip(self._features(picture, grey), self._layers, strict=True):
            chosen = self._chosen(opacity, maps[0])
            for kind, style in zip(maps, styles, strict=True):
                for features in self._shown(kind, chosen):
                    yield features / style.scale, style

    def _drawn(
        self, features: Tensor, generator: torch.Generator, samples: int | None = None
    ) -> Tensor:
        samples = samples or self.config.samples
        where = sample_positions(len(features), samples, generator, features.device)
        return chosen_rows(features, where)

    def _apart(self, style: _Slices, ours: Tensor, generator: torch.Generator) -> Tensor:
        return style.distance(self._drawn(ours, generator, MOST_SORTED), generator)

    def _features(self, picture: Tensor, grey: Tensor | None = None) -> list[list[Tensor]]:
        """Per layer, the maps of the picture in colour, in grey, or both."""
        grey = luma(picture) if grey is None else grey
        kinds = [picture] * self.config.colour + [grey] * self.config.grey
        maps = self._network.features(torch.cat(kinds), self.config.layers or None)
        return [list(layer.split(len(picture))) for layer in maps]

    def _described(self, maps: Tensor) -> _Layer:
        features = _positions(maps)[0]
        scale = features.square().mean().sqrt().item() or 1.0  # a silent layer stays as it is
        features = features / scale
        kept = self._kept(features)
        slices = _Slices.of(kept) if self.config.distribution else None
        return _Layer(kept, moments(features), slices, scale)

    def _kept(self, features: Tensor) -> Tensor:
        count = self.most_style_positions
        return features[sample_positions(len(features), count, self._generator, features.device)]

    def _chosen(self, opacity: Tensor, maps: Tensor) -> list[Int[Tensor, " _"]]:
        """For each picture, the positions of `maps` that show mostly smoke."""
        rows, columns = maps.shape[2:]
        shown = functional.adaptive_avg_pool2d(opacity.detach()[:, None], (rows, columns))
        chosen = []
        for values in shown.flatten(1):
            where = (values > self.config.opacity_threshold).nonzero()[:, 0]
            if len(where) < self.fewest_positions:
                top = values.topk(min(self.fewest_positions, len(values)))
                where = top.indices[top.values > self.least_opacity]
            chosen.append(where)
        return chosen

    @staticmethod
    def _shown(
        maps: Float[Tensor, "b c r k"], chosen: list[Int[Tensor, " _"]]
    ) -> Iterator[Float[Tensor, "_ c"]]:
        """The chosen vectors of every picture that has any."""
        for features, where in zip(_positions(maps), chosen, strict=True):
            if len(where):
                yield chosen_rows(features, where)


def style_scale(
    style_image: FloatArray, size: int, cells: float | None = None, *, drawn: bool = False
) -> float:
    """Shorter side of a style image relative to views, for its strokes to span some cells.

    Args:
        style_image: Linear RGB `[r, c, 3]`.
        size: Shorter side of the views, pixels.
        cells: The same in cells; a cell a pixel unless given.
        drawn: Whether a decoder draws what is finer than cells.
    """
    cells = float(size) if cells is None else cells
    return picture_cells(style_image, cells, size, drawn=drawn) / cells


def _positions(maps: Float[Tensor, "b c r k"]) -> Float[Tensor, "b n c"]:
    return maps.flatten(2).transpose(1, 2)


def _squares(picture: Float[Tensor, "b c r k"], side: int) -> Float[Tensor, "b c _ _"]:
    """Means over squares of some pixels along a side, side by side; none if too few."""
    if side > min(picture.shape[2:]):
        return picture[:, :, :0, :0]
    return functional.avg_pool2d(picture, side)


def _resized(image: Tensor, shorter: int) -> Tensor:
    rows, columns = image.shape[2:]
    factor = shorter / min(rows, columns)
    size = (max(32, round(rows * factor)), max(32, round(columns * factor)))
    return functional.interpolate(image, size, mode="bilinear", antialias=True)
