"""How wide the strokes of a picture are, and how large it is to be shown for cells to have them.

A stroke is a ridge, bright or dark: the picture is extremal across it. Blurred by as much as it is
wide, it stands out most; so each point of a ridge has a width. They are averaged over the area that
ridges cover, weighed by their contrast.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt, gaussian_filter, gaussian_filter1d
from torch.nn import functional

from vnca.core import AnyArray, BoolArray, FloatArray
from vnca.core.colour import linear_to_srgb

STROKE_CELLS = 3.0
"""Cells that a stroke spans where cells are all that is seen."""
DRAWN_STROKE_CELLS = 2.0
"""Cells that it spans where a decoder draws what is finer than they are."""
STROKE_PIXELS = 4.0
"""Pixels that it spans at least: the finer marks in it are a quarter as wide."""
FINEST, COARSEST = 3 / 128, 3 / 48
"""Relative to the picture's shorter side: what is finer or coarser is taken for this. A picture of
finer strokes would be far larger than a block, one of coarser ones would have too few cells."""

_SIZE = 256  # pixels along the shorter side in which ridges are sought
_FIRST, _AN_OCTAVE, _SCALES = 0.63, 3, 18  # of the blurs, pixels
_GAMMA = 0.75  # of the normalisation over scales, for ridges (Lindeberg 1998)
_WIDTH = pi * sqrt(1 / (2 * _GAMMA))  # of a stripe, in units of the blur it stands out most in
_BESIDE = 0.6  # pixels between a point of a ridge and its crest, at most
_AWAY = 3.0  # blurs from the border of what is shown, at least: beyond it is something else
_FAINTEST = 0.01  # contrast that is structure, of 0 to 1
_AROUND = 3.0  # of the window in which directions agree, in units of the blur


class Ridges(NamedTuple):
    """Points on the crests of strokes.

    Attributes:
        area: What each stands for, `[n]`: contrast times width.
        width: Of the stroke there, pixels, `[n]`.
    """

    area: AnyArray
    width: AnyArray

    @property
    def mean_width(self) -> float:
        """Pixels: the geometric mean over the area; 0 if there are none."""
        total = self.area.sum()
        return 2 ** float((self.area * np.log2(self.width)).sum() / total) if total > 0 else 0.0


def find_ridges(values: AnyArray, where: BoolArray | None = None) -> Ridges:
    """The strokes of a picture.

    Args:
        values: `[r, c]`.
        where: Pixels of a picture that is shown in them alone, `[r, c]`; all unless given.

    Reference: Lindeberg 1998, section 5 (edge and ridge detection with automatic scale selection).
    """
    inside = None if where is None else distance_inside(where)
    blurs = _FIRST * 2 ** (np.arange(_SCALES) / _AN_OCTAVE)
    found = [_ridges(values, blur) for blur in blurs]
    parts = []
    for at in range(1, len(blurs) - 1):
        (below, _), (strength, crest), (above, _) = found[at - 1 : at + 2]
        here = crest & (strength > _FAINTEST) & (strength >= below) & (strength > above)
        if inside is not None:
            here &= inside > _AWAY * blurs[at]
        below, strength, above = below[here], strength[here], above[here]
        # Between the blurs, where the parabola through the three is highest.
        beside = (below - above) / (2 * (below - 2 * strength + above))
        blur = _FIRST * 2 ** ((at + beside) / _AN_OCTAVE)
        parts.append((strength * blur, _WIDTH * blur))
    return Ridges(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def distance_inside(where: BoolArray) -> AnyArray:
    """How far each pixel is from those that are not chosen, or from the border, `[r, c]`."""
    return np.asarray(distance_transform_edt(np.pad(where, 1)))[1:-1, 1:-1]


def structure_tensor(
    colours: AnyArray, shown: BoolArray, blur: float
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """The structure tensor where it is shown: cos and sin of twice the direction, and its trace.

    Args:
        colours: `[r, c, n]`.
        shown: `[r, c]`.
        blur: Of the gradients, pixels.

    Returns:
        Three of `[r, c]`; the direction, towards growing columns and rows, is across strokes.

    Reference: Förstner and Gülch 1987; Di Zenzo 1986 (of a colour picture).
    """

    def slope(axis: int) -> AnyArray:
        along = gaussian_filter1d(colours, blur, axis=axis, order=1)
        return gaussian_filter1d(along, blur, axis=1 - axis) * shown[..., None]

    rows, columns = slope(0), slope(1)
    xx, yy, xy = (
        gaussian_filter((one * other).sum(-1), _AROUND * blur)
        for one, other in ((columns, columns), (rows, rows), (rows, columns))
    )
    return xx - yy, 2 * xy, xx + yy


def stroke_width(picture: FloatArray) -> float | None:
    """Width of the strokes of a picture, relative to its shorter side; None if it is flat.

    The geometric mean over the ridges of the colour that varies most.

    Args:
        picture: Linear RGB `[r, c, 3]`.
    """
    shorter = min(picture.shape[:2])
    if shorter > _SIZE:
        picture, shorter = _reduced(picture, _SIZE / shorter), _SIZE
    width = find_ridges(_principal(linear_to_srgb(picture.clip(0, 1)))).mean_width
    return width / shorter if width > 0 else None


def picture_cells(picture: FloatArray, cells: float, pixels: int, *, drawn: bool = False) -> float:
    """Cells along the shorter side at which a picture is best shown.

    Its strokes then span three cells, two where they are drawn, and four pixels at least.
    A drawn picture fills a view, however large its strokes. A flat one has none to span anything:
    it is shown once in a view.

    Args:
        picture: Linear RGB `[r, c, 3]`.
        cells: Those across a view of what is trained on.
        pixels: The same in pixels.
        drawn: Whether a decoder draws what is finer than cells.
    """
    width = stroke_width(picture)
    if width is None:
        return cells
    stroke = max(DRAWN_STROKE_CELLS if drawn else STROKE_CELLS, STROKE_PIXELS * cells / pixels)
    wanted = stroke / min(max(width, FINEST), COARSEST)
    return max(wanted, cells) if drawn else wanted


def _reduced(picture: FloatArray, factor: float) -> FloatArray:
    size = [round(n * factor) for n in picture.shape[:2]]
    maps = torch.from_numpy(np.ascontiguousarray(picture, np.float32)).permute(2, 0, 1)[None]
    reduced = functional.interpolate(maps, size, mode="bilinear", antialias=True)
    return reduced[0].permute(1, 2, 0).numpy()


def _principal(colours: AnyArray) -> AnyArray:
    """`[r, c]`: colours along the direction in which they vary most."""
    centred = colours - colours.mean((0, 1))
    axes = np.linalg.eigh(np.einsum("rci,rcj->ij", centred, centred))[1]
    return centred @ axes[:, -1]


def _ridges(values: AnyArray, blur: float) -> tuple[AnyArray, BoolArray]:
    """How much each pixel of a blurred picture is a ridge, and whether it lies on the crest."""

    def derivative(*order: int) -> AnyArray:
        return gaussian_filter(values, blur, order, mode="reflect")  # pyright: ignore[reportArgumentType]

    yy, xy, xx = derivative(2, 0), derivative(1, 1), derivative(0, 2)
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    bend = np.where(middle >= 0, middle + half, middle - half)  # the stronger curvature
    # Across: of the two rows of (H - λ'), λ' the weaker, the longer one is the direction.
    weak = np.where(middle >= 0, middle - half, middle + half)
    one, other = np.stack([xx - weak, xy]), np.stack([xy, yy - weak])
    lengths = np.hypot(*one), np.hypot(*other)
    across = np.where(lengths[0] >= lengths[1], one, other) / np.maximum(
        np.maximum(*lengths), 1e-12
    )
    slope = across[0] * derivative(0, 1) + across[1] * derivative(1, 0)
    strength = blur ** (2 * _GAMMA) * np.abs(bend)
    return strength, np.abs(slope) <= _BESIDE * np.abs(bend)
