"""Solid texturing by a network from noise to colour: Gutierrez et al. 2020.

A pyramid of noise, six scales of three channels, each half as fine as the next, goes through a 3D
network from coarse to fine: what comes from the coarser scale is doubled, joined to what the noise
of this scale became, and goes on through two convolutions of 3³ and one of 1³ with batch
normalisation and leaky rectifiers; four channels more at each scale, 24 in the end. Nothing is
padded, and noise is a hash of its place, so that any part of any block can be made alone, and a
block whose noise repeats is its own neighbour.

It is trained on slices one voxel thick along the axes, with what they depend on and no more, by
Gram matrices of the picture's features. As published but for: the network that compares, which is
that of the comparison and not VGG19; the logistic function at the end, which keeps colours in
range; its pace, Adam at 0.01 with slices of the comparison's size, which fits minutes on a CPU.

Reference: Gutierrez, Rabin, Galerne and Hurtut 2020, "On Demand Solid Texture Synthesis Using Deep
3D Networks", sections 3 and 4.
"""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from vnca.core import FloatArray, IntArray
from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.engine.automaton import hash_cells, mask_key, mix
from vnca.features import FeatureNetwork
from vnca.io.picture import resize

SCALES, NOISES, WIDER = 6, 3, 4
"""Scales of noise, its channels, and channels that are added at each scale."""
REACH = 2
"""Voxels that a block of convolutions loses on every side."""
LEARNING_RATE = 0.01
SLICES = 3
"""In an iteration, one along each axis."""
PIECE = 64
"""Voxels along an edge of what is made at a time."""
SMALLEST_STYLE = 64

Region = tuple[IntArray, IntArray]
"""Voxels from a corner to another, the second outside; each `[3]`."""


def noise(region: Region, scale: int, seed: int, period: int | None = None) -> Tensor:
    """Noise `[1, 3, x, y, z]` from 0 to 1 in a region of a scale: a hash of place and seed.

    Args:
        region: In voxels of this scale.
        scale: 0 is the finest.
        seed: Of the texture.
        period: Voxels of the finest scale after which it repeats, a multiple of 2 ** scale.
    """
    along = [np.arange(a, b, dtype=np.int32) for a, b in zip(*region, strict=True)]
    if period is not None:
        along = [places % np.int32(period >> scale) for places in along]
    cells = np.stack(np.meshgrid(*along, indexing="ij"), -1).reshape(-1, 3).astype(np.int32)
    hashes = hash_cells(cells)
    drawn = [mix(hashes ^ mask_key(seed, NOISES * scale + n)) for n in range(NOISES)]
    values = (np.stack(drawn) / 2.0**32).astype(np.float32)
    return torch.from_numpy(values).view(1, NOISES, *(len(a) for a in along))


def _block(before: int, after: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for side in (3, 3, 1):
        layers += [nn.Conv3d(before, after, side), nn.BatchNorm3d(after), nn.LeakyReLU(0.01)]
        before = after
    return nn.Sequential(*layers)


class Generator(nn.Module):
    """From noise to colour, in any region."""

    def __init__(self) -> None:
        super().__init__()
        widths = [WIDER * (n + 1) for n in range(SCALES)]  # coarse to fine
        self.noises = nn.ModuleList(_block(NOISES, WIDER) for _ in range(SCALES))
        self.before = nn.ModuleList(nn.BatchNorm3d(width) for width in widths[:-1])
        self.joined = nn.ModuleList(_block(width, width) for width in widths[1:])
        self.colour = nn.Conv3d(widths[-1], 3, 1)

    def forward(self, region: Region, seed: int, period: int | None = None) -> Tensor:
        """Colours in sRGB `[1, 3, x, y, z]` in a region of the finest scale, from 0 to 1."""
        return torch.sigmoid(self.colour(self._at(region, 0, seed, period)))

    def _at(self, region: Region, scale: int, seed: int, period: int | None) -> Tensor:
        """What there is in a region of a scale, from the noise of this one and of coarser ones."""
        number, (lower, upper) = SCALES - 1 - scale, region
        if number == 0:
            return self._noise(region, scale, seed, period)
        wider = lower - REACH, upper + REACH
        coarser = wider[0] // 2, -(-wider[1] // 2)
        from_there = self.before[number - 1](self._at(coarser, scale + 1, seed, period))
        from_there = functional.interpolate(from_there, scale_factor=2, mode="nearest")
        spare, wanted = wider[0] - 2 * coarser[0], wider[1] - wider[0]
        x, y, z = (slice(a, a + n) for a, n in zip(spare, wanted, strict=True))
        from_there = from_there[:, :, x, y, z]
        from_here = self._noise(wider, scale, seed, period)
        return self.joined[number - 1](torch.cat([from_there, from_here], 1))

    def _noise(self, region: Region, scale: int, seed: int, period: int | None) -> Tensor:
        wider = region[0] - REACH, region[1] + REACH
        drawn = noise(wider, scale, seed, period)
        return self.noises[SCALES - 1 - scale](drawn)


def trained(
    style: FloatArray, network: FeatureNetwork, *, cells: float, slice_size: int, seed: int = 0
) -> Iterator[Generator]:
    """The generator after each iteration, without end.

    Args:
        style: Linear RGB `[r, c, 3]`.
        network: What compares slices.
        cells: Along the shorter side of the picture.
        slice_size: Rows and columns of a slice, voxels.
        seed: Same seed, same generators.
    """
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    factor = max(cells, SMALLEST_STYLE) / min(style.shape[:2])
    size = (round(factor * side) for side in style.shape[:2])
    picture = linear_to_srgb(resize(style, *size).clip(0, 1)).astype(np.float32)
    with torch.no_grad():
        wanted = grams(network, torch.from_numpy(picture).permute(2, 0, 1)[None])
    generator = Generator()
    optimiser = torch.optim.Adam(generator.parameters(), lr=LEARNING_RATE)
    while True:
        optimiser.zero_grad()
        for axis in range(SLICES):
            lower = random.integers(-(2**20), 2**20, 3).astype(np.int32)
            side = np.full(3, slice_size, np.int32)
            side[axis] = 1
            colour = generator((lower, lower + side), int(random.integers(2**31)))
            # Rows downwards: up in the block is up in the picture.
            shown = colour.squeeze(axis + 2).flip(3).transpose(2, 3)
            found = grams(network, shown)
            distance(found, wanted).backward()
        optimiser.step()
        yield generator


def grams(network: FeatureNetwork, picture: Tensor) -> list[Tensor]:
    """Gram matrices of a picture's features, by layer, over the positions."""
    flat = (maps[0].flatten(1) for maps in network.features(picture))
    return [features @ features.T / features.shape[1] for features in flat]


def distance(found: Sequence[Tensor], wanted: Sequence[Tensor]) -> Tensor:
    """Squared differences over the squares of what is wanted, summed over the layers."""
    terms = [
        (ours - theirs).square().sum() / theirs.square().sum()
        for ours, theirs in zip(found, wanted, strict=True)
    ]
    return torch.stack(terms).sum()


@torch.no_grad()
def on_demand(generator: Generator, size: int, *, seed: int = 0) -> FloatArray:
    """A block `[size, size, size, 3]`, linear RGB, made piece by piece; it tiles space.

    Args:
        generator: A trained one.
        size: Cells along an edge, a multiple of 32.
        seed: Same seed, same block.
    """
    generator.eval()
    block = np.empty((size, size, size, 3), np.float32)
    for corner in product(range(0, size, PIECE), repeat=3):
        lower = np.array(corner, np.int32)
        upper = np.minimum(lower + PIECE, size).astype(np.int32)
        colour = generator((lower, upper), seed, period=size)[0].permute(1, 2, 3, 0).numpy()
        x, y, z = (slice(a, b) for a, b in zip(lower, upper, strict=True))
        block[x, y, z] = srgb_to_linear(colour)
    generator.train()
    return block
