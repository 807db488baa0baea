"""Aurand et al. 2022, the feed-forward network: it moves or multiplies smoke as it comes.

Known from notes of readers; widths, patches, views, optimiser, and whether the output is a velocity
or a factor, are nowhere to be found and are ours. One network learns one picture, without targets,
from views of its own output; nothing ties frames but that equal smoke is changed equally.

Reference: Aurand, Ortiz, Nauer and Azevedo 2022, section 5.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar, Literal, cast

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from vnca.peers import Clip, Look, Name, Settings, Tell, require_at_least
from vnca.peers.aurand import equalised
from vnca.peers.gram import GramLoss
from vnca.peers.transport import pulled
from vnca.peers.views import Frustum, pictures

MARGIN = 32
"""Cells beyond a tile that what is inside depends on: 30, rounded up to the network's stride."""
_STRIDE = 4
_LEAST_SMOKE = 0.05


@dataclass(frozen=True, kw_only=True)
class ForwardSettings(Settings):
    """Aurand 2022, feed-forward: a network learns on patches, then changes each frame at once."""

    name: ClassVar[Name] = "aurand-forward"
    published_gamma: ClassVar[float] = 0.1

    iterations: int = 300
    """Steps of training."""
    changes: Literal["velocity", "density"] = "velocity"
    """What the network gives: a displacement of the smoke, or a factor of its density. In trials
    the second learned nothing but to fade the smoke."""
    rate: float = 3e-4
    """Of Adam."""
    patch: int = 48
    """Cells along each side of the patches it is trained on."""
    views: int = 2
    """Views of a patch in each step, from anywhere around."""
    cap: float = 4.0
    """The longest displacement along an axis, cells."""
    most: float = 4.0
    """The largest factor; the smallest is its inverse."""
    tile: int = 128
    """Cells along each side of the tiles in which frames are changed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_at_least(self, rate=0, patch=16, views=1, cap=0, most=1, tile=8)


class Convolution(nn.Conv3d):
    """A convolution whose sums, without gradients, are the same whatever surrounds a cell.

    Libraries choose how to sum by the size of what they are given. One product of matrices for
    each cell of the kernel, added up in one order, also takes less memory than unfolding.
    """

    def forward(self, input: Tensor) -> Tensor:
        """As `nn.Conv3d` has it."""
        if torch.is_grad_enabled():
            return super().forward(input)
        side, step, pad = self.kernel_size[0], self.stride[0], int(self.padding[0])
        x = functional.pad(input[0], [pad] * 6).permute(1, 2, 3, 0).contiguous()
        counts = [(n - side) // step + 1 for n in x.shape[:3]]
        total = cast("Tensor", self.bias).expand(*counts, self.out_channels)
        for i, j, k in product(range(side), repeat=3):
            shifted = x[i:, j:, k:][::step, ::step, ::step]
            part = shifted[: counts[0], : counts[1], : counts[2]]
            total = total + part.reshape(-1, part.shape[-1]).mm(self.weight[:, :, i, j, k].T).view(
                *counts, -1
            )
        return total.permute(3, 0, 1, 2)[None]


class ForwardNetwork(nn.Module):
    """From density to a displacement or the logarithm of a factor, zero at first."""

    def __init__(self, settings: ForwardSettings) -> None:
        super().__init__()
        self._settings = settings
        self.channels = 3 if settings.changes == "velocity" else 1
        self.down = nn.ModuleList(
            [
                Convolution(1, 32, 5, stride=2, padding=2),
                Convolution(32, 64, 3, stride=2, padding=1),
            ]
        )
        self.middle = nn.ModuleList([Convolution(64, 64, 3, padding=1) for _ in range(4)])
        self.up = nn.ModuleList(
            [Convolution(64, 32, 3, padding=1), Convolution(32, 16, 3, padding=1)]
        )
        self.last = Convolution(16, self.channels, 3, padding=1)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(cast("Tensor", self.last.bias))

    def forward(self, density: Float[Tensor, "x y z"]) -> Float[Tensor, "x y z c"]:
        """The output for smoke whose sides are multiples of four cells."""
        x = density[None, None]
        for layer in (*self.down, *self.middle):
            x = functional.leaky_relu(layer(x))
        for layer in self.up:
            x = functional.interpolate(x, scale_factor=2.0, mode="trilinear")
            x = functional.leaky_relu(layer(x))
        return self.last(x)[0].permute(1, 2, 3, 0)

    def changed(self, density: Float[Tensor, "x y z"], output: Tensor) -> Float[Tensor, "x y z"]:
        """Smoke as an output has it."""
        bounded = torch.tanh(output)
        if self._settings.changes == "velocity":
            return pulled(density, self._settings.cap * bounded)
        return density * (float(np.log(self._settings.most)) * bounded[..., 0]).exp()


def aurand_forward(clip: Clip, look: Look, settings: ForwardSettings, tell: Tell) -> Tensor:
    """Stylised densities `[t, x, y, z]`."""
    total = settings.iterations + len(clip.density)
    network = trained(clip, look, settings, lambda done, loss: tell(done, total, loss))
    found = []
    for t, density in enumerate(clip.density):
        output = tiled(network, density, settings.tile)
        found.append(network.changed(density, output).detach())
        tell(settings.iterations + t + 1, total, None)
    return torch.stack(found)


def trained(
    clip: Clip, look: Look, settings: ForwardSettings, tell: Callable[[int, float], None]
) -> ForwardNetwork:
    """A network that has learned the picture on patches of the clip."""
    random = np.random.default_rng(settings.seed)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        network = ForwardNetwork(settings)
    side = min(settings.patch, min(clip.shape)) // _STRIDE * _STRIDE
    frustum = Frustum(side, side, side)
    loss = GramLoss(
        look,
        side,
        side,
        enlarged=settings.enlarged,
        ratio=side / min(clip.shape[0], clip.shape[2]) if settings.whole_picture else 1.0,
        whole=settings.whole_picture,
        scaling="lnst",
    )
    gamma = settings.gamma_on(clip)
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.rate)
    for done in range(1, settings.iterations + 1):
        patch = _patch(clip.density, side, random)
        output = network(patch)
        around = [(float(random.uniform(0, 360)), 0.0) for _ in range(settings.views)]
        with torch.no_grad():
            # Patches differ, and Gram matrices of networks do by orders of magnitude.
            plain = loss(equalised(pictures(patch, around, gamma, frustum)))
        painted = network.changed(patch, output)
        value = loss(equalised(pictures(painted, around, gamma, frustum))) / plain
        # What is the same everywhere is no pattern: it fades or shifts all of the smoke.
        drift = torch.tanh(output[patch > _LEAST_SMOKE]).mean(0).square().sum()
        optimiser.zero_grad()
        (value + drift).backward()
        optimiser.step()
        tell(done, value.item())
    return network.eval()


@torch.no_grad()
def tiled(
    network: ForwardNetwork, density: Float[Tensor, "x y z"], tile: int
) -> Float[Tensor, "x y z c"]:
    """The output for smoke of any size, tile by tile: as that of all of it at once.

    Args:
        network: What computes it.
        density: The smoke.
        tile: Cells along each side of a tile.
    """
    sides = [-n % _STRIDE for n in density.shape]
    padded = functional.pad(density, [n for side in reversed(sides) for n in (0, side)])
    whole = density.new_empty(*padded.shape, network.channels)
    for inside, around in _tiles(padded.shape, max(_STRIDE, tile // _STRIDE * _STRIDE)):
        local = tuple(
            slice(i.start - a.start, i.stop - a.start) for i, a in zip(inside, around, strict=True)
        )
        whole[inside] = network(padded[around])[local]
    return whole[tuple(slice(n) for n in density.shape)]


Cells = tuple[slice, slice, slice]


def _tiles(shape: torch.Size, tile: int) -> Iterator[tuple[Cells, Cells]]:
    """The cells of every tile, and those that these depend on."""
    for x in range(0, shape[0], tile):
        for y in range(0, shape[1], tile):
            for z in range(0, shape[2], tile):
                inside, around = [], []
                for start, size in zip((x, y, z), shape, strict=True):
                    stop = min(start + tile, size)
                    inside.append(slice(start, stop))
                    around.append(slice(max(0, start - MARGIN), min(size, stop + MARGIN)))
                yield (inside[0], inside[1], inside[2]), (around[0], around[1], around[2])


def _patch(densities: Tensor, side: int, random: np.random.Generator) -> Tensor:
    """A cube of one frame with smoke in it, if one is found in a few draws."""
    patch = densities[0]
    for _ in range(20):
        density = densities[random.integers(len(densities))]
        corner = [int(random.integers(n - side + 1)) for n in density.shape]
        x, y, z = (slice(c, c + side) for c in corner)
        patch = density[x, y, z]
        if (patch > _LEAST_SMOKE).float().mean() > _LEAST_SMOKE:
            break
    return patch
