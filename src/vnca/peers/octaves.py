"""Optimising from coarse to fine."""

from collections.abc import Iterator
from dataclasses import dataclass

import torch

from vnca.peers import Clip, Look, Settings, require_at_least
from vnca.peers.gram import GramLoss
from vnca.peers.transport import resized

_SMALLEST = 8
"""Cells that a coarser octave keeps along each axis."""


@dataclass(frozen=True, eq=False)
class Octave:
    """A clip on coarser cells.

    Attributes:
        clip: With velocities in these cells.
        ratio: How many of them lie along the height of the clip, over those of the finest.
    """

    clip: Clip
    ratio: float


@dataclass(frozen=True, kw_only=True)
class OctaveSettings(Settings):
    """What methods have that go from coarse to fine."""

    octaves: int = 2
    """Resolutions from coarse to fine."""
    octave_scale: float = 1.8
    """How many times as wide cells are in the octave before."""
    sigma: float = 1.2
    """Deviation of the Gaussian over gradients, cells."""
    levels: int = 3
    """Octaves of frequency in which gradients are made equally strong."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_at_least(self, octaves=1, octave_scale=1.1, sigma=0, levels=0)

    def loss(self, look: Look, stage: Octave) -> GramLoss:
        """What compares views of an octave from the front with the picture."""
        columns, _, rows = stage.clip.shape
        return GramLoss(
            look, rows, columns, enlarged=self.enlarged, ratio=stage.ratio, whole=self.whole_picture
        )


def octaves(clip: Clip, count: int, scale: float) -> Iterator[Octave]:
    """The clip on ever finer grids, at last its own.

    Args:
        clip: At full resolution.
        count: How many there are at most; coarser than eight cells there is none.
        scale: How many times as wide a cell is in the octave before.
    """
    for level in reversed(range(count)):
        shape = tuple(int(n / scale**level) for n in clip.shape)
        if level and min(shape) < _SMALLEST:
            continue
        x, y, z = shape
        ratio = z / clip.shape[2]
        moved = clip.velocity.new_tensor([a / b for a, b in zip(shape, clip.shape, strict=True)])
        yield Octave(
            Clip(
                torch.stack([resized(d, (x, y, z)).clamp_min(0) for d in clip.density]),
                torch.stack([resized(u, (x, y, z)) * moved for u in clip.velocity]),
            )
            if level
            else clip,
            ratio,
        )
