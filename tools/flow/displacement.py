"""Fields of motion between two pictures."""

from math import pi

import torch
from jaxtyping import Float
from textures import chance, log_uniform, smooth, uniform
from torch import Generator, Tensor
from torch.nn import functional

STEEPEST = 0.35
"""Largest change of displacement from a pixel to the next; below 1 nothing folds over."""


def random_speeds(
    count: int, random: Generator, *, slowest: float = 0.1, fastest: float = 12.0
) -> Float[Tensor, "count 1 1"]:
    """Pixels between the pictures; in one of twelve nothing moves."""
    return log_uniform(count, slowest, fastest, random) * chance(count, 11 / 12, random)


def random_displacement(
    speeds: Float[Tensor, "b 1 1"], side: int, random: Generator, *, uneven: float = 1.0
) -> Float[Tensor, "b 2 s s"]:
    """Translation mixed with rotation, zoom, shear, smooth random motion and curl noise.

    Args:
        speeds: Root mean square of each field, pixels.
        side: Pixels.
        random: Decides the device too.
        uneven: Up to which share of the speed is not translation.

    Returns:
        Pixels to the right and down, at the pixels of the first picture.
    """
    count = len(speeds)
    parts = torch.stack([_affine(count, side, random), _gusts(count, side, random)], dim=1)
    parts = parts / _rms(parts)
    kind = torch.rand(count, 2, 1, 1, 1, generator=random, device=random.device)
    varying = (parts * kind).sum(dim=1)
    varying = varying - varying.mean(dim=(2, 3), keepdim=True)
    varying = varying / _rms(varying)
    steepest = torch.maximum(
        varying.diff(dim=2).abs().amax(dim=(1, 2, 3)), varying.diff(dim=3).abs().amax(dim=(1, 2, 3))
    )[:, None, None]
    share = uneven * uniform(count, 0, 1, random) * chance(count, 0.75, random)
    varied = torch.minimum(share * speeds, STEEPEST / steepest)
    # Squares of speeds add up, since the varying part has no mean.
    even = (speeds.square() - varied.square()).clamp(min=0).sqrt()
    angle = uniform(count, 0, 2 * pi, random)
    translation = even[:, None] * torch.stack([angle.cos(), angle.sin()], dim=1)
    return translation + varied[:, None] * varying


def sources(flow: Float[Tensor, "b 2 r c"]) -> Float[Tensor, "b 2 r c"]:
    """Where what is seen at each pixel of the second picture was in the first, as an offset.

    The fixed point `u(y) = -flow(y + u(y))`, reached since the field is not steep.
    """
    back = -flow
    for _ in range(6):
        back = -sampled(flow, back)
    return back


def sampled(
    pictures: Float[Tensor, "b n r c"],
    offset: Float[Tensor, "b 2 r c"],
    *,
    mode: str = "bilinear",
    padding: str = "border",
) -> Float[Tensor, "b n r c"]:
    """Values at each pixel plus an offset, right and down, in pixels."""
    rows, columns = pictures.shape[2:]
    down = torch.arange(rows, device=offset.device)[:, None] + offset[:, 1]
    right = torch.arange(columns, device=offset.device) + offset[:, 0]
    grid = torch.stack([(2 * right + 1) / columns - 1, (2 * down + 1) / rows - 1], dim=-1)
    return functional.grid_sample(
        pictures, grid, mode=mode, padding_mode=padding, align_corners=False
    )


def _affine(count: int, side: int, random: Generator) -> Tensor:
    """Rotation, zoom and two shears about a random centre; not scaled."""
    matrix = torch.randn(count, 2, 2, generator=random, device=random.device)
    turn = torch.tensor([[0.0, -1.0], [1.0, 0.0]], device=random.device)
    only_turn = chance(count, 0.3, random)
    matrix = torch.where(only_turn > 0, turn, matrix)
    along = torch.linspace(-1, 1, side, device=random.device)
    at = torch.stack(torch.meshgrid(along, along, indexing="xy"))
    return torch.einsum("bij,jrc->birc", matrix, at)


def _gusts(count: int, side: int, random: Generator) -> Tensor:
    """Smooth random motion, or curl noise, which neither gathers nor spreads; not scaled."""
    # Coarse, since there is no detail, and on twice the side, since the noise repeats.
    coarse = side // 2
    wavelength = log_uniform(count, 24, 160, random).repeat(2, 1, 1) / 4
    noise = smooth(2 * count, coarse, wavelength, random)[:, None, : coarse // 2, : coarse // 2]
    wind = functional.interpolate(noise, (side, side), mode="bicubic", align_corners=False)
    wind = wind.view(2, count, side, side).transpose(0, 1)
    down, right = torch.gradient(wind[:, 0], dim=(1, 2))
    curl = torch.stack([down, -right], dim=1)
    curl = curl / _rms(curl)
    return torch.where(chance(count, 0.5, random)[:, None] > 0, curl, wind)


def _rms(field: Tensor) -> Tensor:
    """Root mean square length of the vectors of each field."""
    squared = field.square().sum(dim=-3, keepdim=True).mean(dim=(-2, -1), keepdim=True)
    return squared.sqrt().clamp(min=1e-9)
