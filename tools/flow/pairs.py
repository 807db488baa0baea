"""Pairs of pictures between which a texture moves in a known way."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import torch
from displacement import (
    random_displacement,
    random_speeds,
    sampled,
    sources,
)
from jaxtyping import Float
from textures import chance, log_uniform, smooth, uniform
from torch import Generator, Tensor
from torch.nn import functional

MOST_REPLACED = 0.4
"""Share of a texture's variance that another takes over at most between the pictures."""


@dataclass(frozen=True)
class Pairs:
    """Grey pictures, the motion from the first to the second, and where it can be seen.

    Attributes:
        before: As displayed, 0–1.
        after: The same.
        flow: Pixels to the right and down, at the pixels of `before`.
        seen: 1 where there is texture, 0 in empty background.
    """

    before: Float[Tensor, "b r c"]
    after: Float[Tensor, "b r c"]
    flow: Float[Tensor, "b 2 r c"]
    seen: Float[Tensor, "b r c"]


def random_pairs(
    textures: Float[Tensor, "n s s"],
    count: int,
    side: int,
    random: Generator,
    *,
    easy: float = 0.0,
) -> Pairs:
    """Pairs to train on: everything that may differ does.

    Args:
        textures: Of zero mean and unit variance, from `bank`.
        count: Number of pairs.
        side: Of the pictures, pixels.
        random: Decides the device too; the same as that of the textures.
        easy: Share of pairs that fill the picture and keep their texture.
    """
    hard = 1 - chance(count, easy, random)
    flow = random_displacement(random_speeds(count, random), side, random)
    replaced = uniform(count, 0, MOST_REPLACED, random) * chance(count, 0.75, random) * hard
    before, after = moving_texture(textures, flow, replaced, random)
    contrast, grey = log_uniform(count, 0.03, 0.3, random), uniform(count, 0.25, 0.75, random)
    lit = chance(count, 0.4, random)
    before = grey + contrast * before
    contrast = contrast * log_uniform(count, 0.75, 1.33, random) ** lit
    after = grey + lit * uniform(count, -0.08, 0.08, random) + contrast * after
    silhouette = random_silhouette(count, side, random)
    silhouette = torch.maximum(silhouette, chance(count, 0.35, random)).maximum(1 - hard)
    carried = torch.where(
        chance(count, 0.2, random) > 0,
        sampled(silhouette[:, None], sources(flow))[:, 0],
        silhouette,
    )
    background = uniform(count, 0, 1, random) * chance(count, 0.7, random)
    # Thicker smoke is brighter or darker; it stays while the texture moves.
    shade = 1 + 0.2 * chance(count, 0.5, random) * smooth(count, side, 40.0, random)
    before = torch.lerp(background.expand_as(before), before * shade, silhouette)
    after = torch.lerp(background.expand_as(after), after * shade, carried)
    pair = _blurred(torch.stack([before, after], dim=1), random)
    noise = torch.randn(pair.shape, generator=random, device=random.device)
    strength = uniform(count, 0, 0.02, random) * chance(count, 0.3, random)
    pair = (pair + strength[:, None] * noise).clamp(0, 1)
    return Pairs(pair[:, 0], pair[:, 1], flow, silhouette)


def moving_texture(
    textures: Float[Tensor, "n s s"],
    flow: Float[Tensor, "b 2 r c"],
    replaced: Float[Tensor, "b 1 1"],
    random: Generator,
) -> tuple[Float[Tensor, "b r c"], Float[Tensor, "b r c"]]:
    """A texture before and after `flow`; of zero mean and unit variance before.

    Args:
        textures: To choose from; turned, mirrored, scaled and shifted.
        flow: Pixels to the right and down.
        replaced: Share of the variance that another texture, moving along, takes over.
        random: Decides the device too.
    """
    count = len(flow)
    offsets = (torch.zeros_like(flow), sources(flow))
    old = _moving(textures, offsets, random)
    new = _moving(textures, offsets, random)[:, 1]
    # A second texture goes into some, of another size or kind.
    mixed = 0.5 * uniform(count, 0, 1, random) * chance(count, 0.3, random)
    old = (1 - mixed[:, None]) * old + mixed[:, None] * _moving(textures, offsets, random)
    mean, deviation = old[:, 0].mean((1, 2)), old[:, 0].std((1, 2)).clamp(min=1e-3)
    old = (old - mean.view(-1, 1, 1, 1)) / deviation.view(-1, 1, 1, 1)
    new = (new - new.mean((1, 2), keepdim=True)) / new.std((1, 2), keepdim=True).clamp(min=1e-3)
    return old[:, 0], (1 - replaced).sqrt() * old[:, 1] + replaced.sqrt() * new


def random_silhouette(count: int, side: int, random: Generator) -> Float[Tensor, "b s s"]:
    """How opaque smoke is: one or more soft blobs, 0 outside."""
    along = torch.linspace(-1, 1, side, device=random.device)
    right = along - uniform(count, -0.4, 0.4, random)
    down = along[:, None] - uniform(count, -0.4, 0.4, random)
    distance = torch.hypot(
        right / log_uniform(count, 0.4, 1.2, random), down / log_uniform(count, 0.4, 1.2, random)
    )
    ragged = 0.4 * smooth(count, side, log_uniform(count, 16, 80, random), random)
    return torch.sigmoid(log_uniform(count, 3, 40, random) * (1 - distance + ragged))


def _moving(textures: Tensor, offsets: Sequence[Tensor], random: Generator) -> Tensor:
    """One texture a pair, seen through each of the offsets."""
    count, _, rows, columns = offsets[0].shape
    side = textures.shape[-1]
    chosen = textures[
        torch.randint(len(textures), (count,), generator=random, device=random.device)
    ]
    angle, zoom = uniform(count, 0, 2 * pi, random), log_uniform(count, 0.6, 1.4, random)
    mirror = 1 - 2 * chance(count, 0.5, random)
    middle = [uniform(count, -0.2, 0.2, random) for _ in range(2)]
    right = torch.arange(columns, device=random.device) - (columns - 1) / 2
    down = (torch.arange(rows, device=random.device) - (rows - 1) / 2)[:, None]
    grids: list[Tensor] = []
    for offset in offsets:
        x, y = right + offset[:, 0], down + offset[:, 1]
        u = mirror * zoom * (angle.cos() * x - angle.sin() * y) * (2 / side) + middle[0]
        v = zoom * (angle.sin() * x + angle.cos() * y) * (2 / side) + middle[1]
        grids.append(torch.stack([u, v], dim=-1))
    seen = functional.grid_sample(
        chosen[:, None],
        torch.cat(grids, dim=1),
        mode="bicubic",
        padding_mode="reflection",
        align_corners=False,
    )[:, 0]
    return seen.view(count, len(offsets), rows, columns)


def _blurred(pair: Tensor, random: Generator) -> Tensor:
    """Some of the pairs, each by its own Gaussian of up to 1.2 pixels."""
    count = len(pair)
    width = uniform(count, 0.3, 1.2, random)
    taps = torch.exp(-0.5 * (torch.arange(-3, 4, device=pair.device) / width) ** 2)
    taps = torch.where(
        chance(count, 0.4, random) > 0, taps / taps.sum(-1, keepdim=True), _ONE.to(pair.device)
    )
    kernel = (taps.transpose(1, 2) * taps).repeat_interleave(2, dim=0)[:, None]
    padded = functional.pad(pair.flatten(0, 1)[None], [3] * 4, mode="replicate")
    return functional.conv2d(padded, kernel, groups=2 * count)[0].view_as(pair)


_ONE = torch.tensor([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
