"""The main colours of a picture, exchanged for others, or for those of another picture."""

from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import linear_to_srgb
from vnca.direction.colour.oklab import from_oklab, oklab

COLOURS = 5
"""Main colours that are found in a picture."""
_PIXELS, _ROUNDS = 4096, 40
_LEAST_SPREAD = 0.05
_FLOOR = 1e-4
_APART = 0.08
"""Colours nearer to each other are one."""


def main_colours(picture: AnyArray, count: int = COLOURS) -> AnyArray:
    """The main colours of a picture, those of most pixels first.

    The same for the same picture: it begins with the pixels that lie farthest apart.

    Args:
        picture: `[r, c, 3]`, linear RGB.
        count: How many, at most.

    Returns:
        `[k, 3]` in OKLab.

    Reference: Lloyd 1982, in the space of Chang et al. 2015.
    """
    pixels = oklab(picture.reshape(-1, 3))
    pixels = pixels[:: max(1, len(pixels) // _PIXELS)]
    centres = [pixels[np.linalg.norm(pixels - pixels.mean(axis=0), axis=1).argmin()]]
    for _ in range(count - 1):
        away = np.min([np.linalg.norm(pixels - centre, axis=1) for centre in centres], axis=0)
        if away.max() < _FLOOR:
            break
        centres.append(pixels[away.argmax()])
    found = np.array(centres)
    of = np.zeros(len(pixels), int)
    for _ in range(_ROUNDS):
        of = np.linalg.norm(pixels[:, None] - found, axis=-1).argmin(axis=1)
        means = [
            pixels[of == k].mean(axis=0) if (of == k).any() else c for k, c in enumerate(found)
        ]
        if np.allclose(means, found, atol=1e-7):
            break
        found = np.array(means)
    sizes = np.bincount(of, minlength=len(found))
    kept: list[AnyArray] = []
    for centre in found[np.argsort(-sizes, kind="stable")]:
        if all(np.linalg.norm(centre - other) >= _APART for other in kept):
            kept.append(centre)
    return np.array(kept)


def codes(palette: AnyArray) -> list[str]:
    """Colours `[k, 3]` in OKLab as texts such as #1b2a49."""
    shown = np.rint(255 * linear_to_srgb(from_oklab(palette)).clip(0, 1)).astype(int)
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in shown]


@dataclass(frozen=True, eq=False)
class Recolouring:
    """Takes colours to others: main ones exactly, those in between in between.

    Attributes:
        old: `[k, 3]` in OKLab.
        new: What becomes of each.

    Reference: Chang et al. 2015, "Palette-based photo recoloring", section 3.5.
    """

    old: AnyArray
    new: AnyArray

    def of(self, linear: FloatArray) -> FloatArray:
        """Linear RGB `[n, 3]` with the colours exchanged."""
        apart = np.linalg.norm(self.old[:, None] - self.old, axis=-1)
        others = apart[~np.eye(len(apart), dtype=bool)]
        spread = max(_LEAST_SPREAD, float(others.mean()) if others.size else 1.0)
        weights = np.linalg.solve(_bell(apart, spread), np.eye(len(self.old)))
        lab = oklab(linear)
        away = np.linalg.norm(lab[:, None] - self.old, axis=-1)
        shares = np.maximum(_bell(away, spread) @ weights, 0)
        shares /= np.maximum(shares.sum(axis=1, keepdims=True), _FLOOR)
        return in_range(from_oklab(lab + shares @ (self.new - self.old)))


def _bell(distance: AnyArray, spread: float) -> AnyArray:
    return np.exp(-((distance / spread) ** 2))


@dataclass(frozen=True, eq=False)
class Matching:
    """Takes the colours of one picture to those of another, as a whole.

    The linear map that moves them least among those after which mean and covariance are the
    other's; what it does follows from the pictures alone, so it never flickers.

    Reference: Pitié and Kokaram 2007, "The linear Monge-Kantorovitch linear colour mapping".
    """

    mean: AnyArray
    matrix: AnyArray
    to: AnyArray

    @classmethod
    def between(cls, picture: AnyArray, other: AnyArray) -> "Matching":
        """From the colours `[..., 3]` of one picture to those of another, both linear RGB."""
        ours, theirs = (oklab(each.reshape(-1, 3)) for each in (picture, other))
        spread, wanted = (np.cov(each.T) + _FLOOR * np.eye(3) for each in (ours, theirs))
        root = _root(spread)
        back = np.linalg.inv(root)
        matrix = back @ _root(root @ wanted @ root) @ back
        return cls(ours.mean(axis=0), matrix, theirs.mean(axis=0))

    def of(self, linear: FloatArray) -> FloatArray:
        """Linear RGB `[n, 3]` in the other picture's colours."""
        return in_range(from_oklab((oklab(linear) - self.mean) @ self.matrix.T + self.to))


def _root(matrix: AnyArray) -> AnyArray:
    values, axes = np.linalg.eigh(matrix)
    return (axes * np.sqrt(np.maximum(values, 0))) @ axes.T


def in_range(linear: AnyArray) -> FloatArray:
    """Colours that there are: linear RGB from 0 to 1."""
    return linear.clip(0, 1).astype(np.float32)
