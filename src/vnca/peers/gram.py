"""Likeness to a picture by Gram matrices of a frozen network, as the other methods measure it.

The originals compare layers of GoogLeNet, or of VGG19 (Aurand 2022). GoogLeNet's weights come with
no package; here it is a VGG, in layers that see as far.

Reference: Gatys, Ecker and Bethge 2016.
"""

from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.core import FloatArray
from vnca.core.colour import linear_to_srgb, luminance
from vnca.features import SMALLEST, FeatureNetwork
from vnca.features.strokes import picture_cells
from vnca.io.picture import resize
from vnca.peers import Look

VGG_LAYERS = ("relu2_2", "relu3_3", "relu4_3")
"""In the place of GoogLeNet's `conv2d2`, `mixed3b` and `mixed4b`."""
Scaling = Literal["tnst", "lnst"]
"""How a Gram matrix is divided: by TNST's (4 A² C² 10⁶) afterwards, or LNST's 2 A C before."""


def grey_picture(picture: FloatArray) -> FloatArray:
    """Brightness as perceived, `[r, c]` in 0–1, of linear RGB `[r, c, 3]`."""
    return linear_to_srgb(luminance(picture).clip(0, 1)).astype(np.float32)


class GramLoss:
    """How far grey pictures of one size are from a picture.

    As published, the picture is cut to their shape from its middle, and resized to their pixels. So
    its strokes would drown in the cells of small smoke: unless that is asked for, they span three.
    """

    def __init__(
        self,
        look: Look,
        rows: int,
        columns: int,
        *,
        enlarged: float = 1.0,
        ratio: float = 1.0,
        whole: bool = False,
        scaling: Scaling = "tnst",
    ) -> None:
        """Prepare the picture.

        Args:
            look: The picture, and the network, whose device is that of the loss.
            rows: Of the pictures that will be compared.
            columns: Likewise.
            enlarged: How many times as large the network sees them; more where a side would be
                smaller than it takes.
            ratio: Cells of these pictures over the finest ones, along a length: of an octave.
            whole: Show the picture as large as the smoke, as published.
            scaling: How Gram matrices are divided.
        """
        self._network, self._scaling = look.network, scaling
        known = all(_has(look.network, layer) for layer in VGG_LAYERS)
        self._layers = VGG_LAYERS if known else look.network.style_layers
        factor = max(enlarged, SMALLEST / min(rows, columns))
        self._size = (round(rows * factor), round(columns * factor))
        if whole:
            target = _filling(look.picture, *self._size)
        else:
            finest = min(rows, columns) / ratio
            cells = picture_cells(_coloured(look.picture), finest, round(finest * enlarged))
            target = _shrunk(look.picture, factor * ratio * cells)
        with torch.no_grad():
            shown = torch.from_numpy(target).to(look.network.device)
            self._target = self._grams(shown[None, None])

    def __call__(self, pictures: Float[Tensor, "b 1 r c"]) -> Float[Tensor, ""]:
        """The distance, summed over pictures and layers; differentiable."""
        grams = self._grams(pictures)
        terms = [
            (ours - theirs).square().sum() for ours, theirs in zip(grams, self._target, strict=True)
        ]
        return torch.stack(terms).sum()

    def _grams(self, pictures: Tensor) -> list[Tensor]:
        if tuple(pictures.shape[2:]) != self._size:
            pictures = functional.interpolate(pictures, self._size, mode="bilinear")
        maps = self._network.features(pictures.expand(-1, 3, -1, -1), self._layers)
        return [self._gram(layer) for layer in maps]

    def _gram(self, maps: Float[Tensor, "b c r k"]) -> Float[Tensor, "b c c"]:
        features = maps.flatten(2)
        gram = features @ features.mT
        channels, area = features.shape[1:]
        # One factor before the square, so that both are sums of squares.
        return gram / (2e3 * area * channels if self._scaling == "tnst" else 2 * area * channels)


def _filling(picture: FloatArray, rows: int, columns: int) -> FloatArray:
    """The middle of a grey picture that has the proportions of so many pixels, at as many."""
    height, width = picture.shape
    scale = min(height / rows, width / columns)
    cut = [max(1, round(n * scale)) for n in (rows, columns)]
    top, left = ((n - c) // 2 for n, c in zip((height, width), cut, strict=True))
    part = picture[top : top + cut[0], left : left + cut[1]]
    return resize(_coloured(part), rows, columns)[..., 0].clip(0, 1)


def _shrunk(picture: FloatArray, shorter: float) -> FloatArray:
    """A grey picture whose shorter side has so many pixels."""
    factor = max(shorter, SMALLEST) / min(picture.shape)
    rows, columns = (max(SMALLEST, round(n * factor)) for n in picture.shape)
    return resize(_coloured(picture), rows, columns)[..., 0].clip(0, 1)


def _coloured(picture: FloatArray) -> FloatArray:
    return np.repeat(picture[..., None], 3, axis=-1)


def _has(network: FeatureNetwork, layer: str) -> bool:
    return layer.replace("relu", "conv") in getattr(network, "convolutions", ())
