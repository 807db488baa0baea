"""Solid texturing by searching neighbourhoods and matching histograms: Kopf et al. 2007.

Every slice of the block along an axis is to look like the picture: each 8 × 8 neighbourhood in it
like the nearest one there. A voxel is the weighted mean of what the neighbourhoods of its three
slices say of it, less of those that are far from their nearest (robustly, |d|^0.8) and of those
whose colours the block has too many of already. From coarse to fine, in three resolutions.

Two things are simpler than published: the nearest is found exactly, by products of matrices in the
principal components of 95 % of the variance, in the place of an approximate tree; and histograms
are counted once for the slices along each axis, in the place of after each voxel.

Reference: Kopf, Fu, Cohen-Or, Deussen, Lischinski and Wong 2007, "Solid Texture Synthesis from 2D
Exemplars", sections 3 and 4.
"""

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from vnca.core import FloatArray
from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.io.picture import resize

SIDE, STEP = 8, 2
"""Of a neighbourhood, and between those that are searched for: every other one."""
ROBUST = 0.8
"""The power of distances that is minimised."""
VARIANCE = 0.95
BINS = 16
LEVELS, COARSE_ITERATIONS = 3, 6
LARGEST_EXEMPLAR = 128
"""Pixels along its sides at most: what is larger is cut to its middle."""
_AT_ONCE = 4096


class Exemplar:
    """The picture at one resolution: its neighbourhoods, and its histogram.

    Attributes:
        patches: `[n, 3 · 8 · 8]`, sRGB, channel by channel.
        histogram: `[3, 16]`, shares.
    """

    def __init__(self, picture: Tensor) -> None:
        """Take the neighbourhoods of a picture `[3, r, c]`."""
        self.patches = functional.unfold(picture[None], SIDE)[0].T.contiguous()
        self.histogram = histogram(picture.flatten(1))
        self._mean = self.patches.mean(0)
        _, values, axes = torch.linalg.svd(self.patches - self._mean, full_matrices=False)
        shares = values.square().cumsum(0) / values.square().sum()
        kept = int((shares < VARIANCE).sum()) + 1
        self._axes = axes[:kept].T.contiguous()
        self._known = (self.patches - self._mean) @ self._axes
        self._squares = self._known.square().sum(1)

    def nearest(self, patches: Tensor) -> Tensor:
        """For each neighbourhood `[m, 192]` which of the picture's is nearest, `[m]`."""
        seen = ((patches - self._mean) @ self._axes).split(_AT_ONCE)
        return torch.cat([(self._squares - 2 * some @ self._known.T).argmin(1) for some in seen])


def histogram(values: Tensor) -> Tensor:
    """Shares `[3, 16]` of values `[3, n]` from 0 to 1."""
    bins = (values.clamp(0, 1) * BINS).long().clamp_max(BINS - 1)
    return torch.stack([torch.bincount(b, minlength=BINS) / b.numel() for b in bins])


def kopf_blocks(
    style: FloatArray, size: int, *, cells: float, seed: int = 0
) -> Iterator[FloatArray]:
    """Blocks `[size, size, size, 3]`, linear RGB, one after each iteration at full size.

    The first begins with pixels of the picture, voxel by voxel. Opposite faces are neighbours.

    Args:
        style: Linear RGB `[r, c, 3]`.
        size: Cells along an edge, a multiple of 4 from 32 on.
        cells: Along the shorter side of the picture.
        seed: Same seed, same blocks.
    """
    random = torch.Generator().manual_seed(seed)
    pictures = exemplars(style, cells)
    first = pictures[0].flatten(1)
    coarsest = size >> (LEVELS - 1)
    drawn = torch.randint(first.shape[1], (coarsest**3,), generator=random)
    block = first[:, drawn].view(3, *3 * (coarsest,))
    for level, picture in enumerate(pictures):
        exemplar = Exemplar(picture)
        if level:
            block = functional.interpolate(block[None], scale_factor=2, mode="trilinear")[0]
        iteration = 0
        while level == LEVELS - 1 or iteration < COARSE_ITERATIONS:
            shift = torch.randint(STEP, (3,), generator=random).tolist()
            block = improved(block.roll(shift, (1, 2, 3)), exemplar)
            block = block.roll([-s for s in shift], (1, 2, 3))
            iteration += 1
            if level == LEVELS - 1:
                yield srgb_to_linear(block.permute(1, 2, 3, 0).numpy()).astype(np.float32)


def exemplars(style: FloatArray, cells: float) -> list[Tensor]:
    """The picture in sRGB `[3, r, c]` at each resolution, coarse to fine."""
    found = []
    for level in reversed(range(LEVELS)):
        factor = cells / min(style.shape[:2]) / 2**level
        rows, columns = (max(SIDE, round(factor * n)) for n in style.shape[:2])
        picture = linear_to_srgb(resize(style, rows, columns).clip(0, 1))
        most = max(SIDE, LARGEST_EXEMPLAR >> level)
        top, left = ((max(0, n - most)) // 2 for n in (rows, columns))
        picture = picture[top : top + most, left : left + most]
        found.append(torch.from_numpy(np.ascontiguousarray(picture.transpose(2, 0, 1))).float())
    return found


def improved(block: Tensor, exemplar: Exemplar) -> Tensor:
    """A block `[3, x, y, z]` after one search and one update of all voxels."""
    total, weight = torch.zeros_like(block), torch.zeros_like(block[:1])
    for axis in (1, 2, 3):
        # Slices with their rows downwards: up in the block is up in the picture.
        slices = block.movedim(axis, 0).flip(3).transpose(2, 3)
        excess = (histogram(block.flatten(1)) - exemplar.histogram).clamp_min(0)
        told = [_said(one, exemplar, excess) for one in slices]
        for gathered, at in ((total, 0), (weight, 1)):
            stacked = torch.stack([pair[at] for pair in told])
            gathered += stacked.transpose(2, 3).flip(3).movedim(0, axis)
    return (total / weight).clamp(0, 1)


def _said(one: Tensor, exemplar: Exemplar, excess: Tensor) -> tuple[Tensor, Tensor]:
    """What the neighbourhoods of a slice `[3, r, c]` say of it, weighted, and their weights."""
    rows, columns = one.shape[1:]
    wrapped = functional.pad(one[None], (0, SIDE - STEP) * 2, mode="circular")
    patches = functional.unfold(wrapped, SIDE, stride=STEP)[0].T
    wanted = exemplar.patches[exemplar.nearest(patches)]
    distance = (patches - wanted).square().sum(1).clamp_min(1e-6).sqrt()
    pixels = wanted.view(len(wanted), 3, -1)
    bins = (pixels.clamp(0, 1) * BINS).long().clamp_max(BINS - 1)
    too_many = sum(excess[channel][bins[:, channel]] for channel in range(3))
    weights = distance[:, None] ** (ROBUST - 2) / (1 + too_many)
    said = (pixels * weights[:, None]).flatten(1)
    sums = (_folded(part, wrapped.shape[2:], rows, columns) for part in (said, weights))
    total, weight = sums
    return total, weight


def _folded(values: Tensor, wrapped: torch.Size, rows: int, columns: int) -> Tensor:
    """Sums `[c, r, c]` of what overlapping neighbourhoods say, wrapped at the borders."""
    image = functional.fold(values.T[None], wrapped, SIDE, stride=STEP)[0]
    inside = image[:, :rows, :columns].clone()
    below, right = image.shape[1] - rows, image.shape[2] - columns
    inside[:, :below] += image[:, rows:, :columns]
    inside[:, :, :right] += image[:, :rows, columns:]
    inside[:, :below, :right] += image[:, rows:, columns:]
    return inside
