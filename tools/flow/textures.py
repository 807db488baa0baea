"""Textures of many kinds, grey, for motion to be seen on.

Every kind is a function of how many, their side in pixels, and a generator; it gives
`[count, side, side]` on the generator's device. `bank` evens out mean and contrast.
"""

import importlib
from collections.abc import Callable, Mapping
from functools import cache
from math import pi

import torch
from jaxtyping import Float
from torch import Generator, Tensor
from torch.nn import functional

from vnca.core.errors import BackendUnavailableError

Kind = Callable[[int, int, Generator], Tensor]

PHOTOGRAPHS = (
    *("astronaut", "brick", "camera", "cell", "chelsea"),
    *("coffee", "grass", "gravel", "retina", "rocket"),
)
"""CC0 or public-domain pictures inside scikit-image, by its names for them."""


def uniform(count: int, low: float, high: float, random: Generator) -> Float[Tensor, "count 1 1"]:
    """One number a picture, evenly distributed."""
    drawn = torch.rand(count, 1, 1, generator=random, device=random.device)
    return low + (high - low) * drawn


def log_uniform(
    count: int, low: float, high: float, random: Generator
) -> Float[Tensor, "count 1 1"]:
    """One number a picture, its logarithm evenly distributed."""
    return low * (high / low) ** uniform(count, 0, 1, random)


def chance(count: int, probability: float, random: Generator) -> Float[Tensor, "count 1 1"]:
    """One zero or one a picture."""
    return (uniform(count, 0, 1, random) < probability).float()


def smooth(count: int, side: int, wavelength: Tensor | float, random: Generator) -> Tensor:
    """Noise of unit variance without detail much finer than `wavelength`, pixels."""
    frequency, _ = _frequencies(side, random)
    return _filtered(torch.exp(-((frequency * wavelength) ** 2)), random, count)


def spectral(count: int, side: int, random: Generator) -> Tensor:
    """Noise with a power law, a band or a direction, in any mixture."""
    frequency, angle = _frequencies(side, random)
    slope = uniform(count, 0, 3, random)
    amplitude = (frequency + 1 / side) ** -slope
    centre, width = log_uniform(count, 1 / 40, 1 / 4, random), uniform(count, 0.1, 0.7, random)
    band = torch.exp(-0.5 * (torch.log(frequency * (1 / centre) + 1e-6) / width) ** 2)
    amplitude = torch.where(chance(count, 0.6, random) > 0, band, amplitude)
    lobe = torch.exp(
        uniform(count, 0, 4, random) * torch.cos(2 * (angle - uniform(count, 0, pi, random)))
    )
    return _filtered(amplitude * lobe ** chance(count, 0.5, random), random, count)


def shaped(count: int, side: int, random: Generator) -> Tensor:
    """Blots, lines and filaments: noise through a threshold, a fold or an envelope."""
    noise = spectral(count, side, random)
    noise = noise / noise.std(dim=(1, 2), keepdim=True)
    shape = torch.randint(3, (count, 1, 1), generator=random, device=random.device)
    blots = torch.tanh(
        log_uniform(count, 1.5, 20, random) * (noise - uniform(count, -1, 1, random))
    )
    lines = torch.exp(-log_uniform(count, 1, 8, random) * noise.abs())
    patches = noise * smooth(count, side, log_uniform(count, 16, 64, random), random)
    return torch.where(shape == 0, blots, torch.where(shape == 1, lines, patches))


def cells(count: int, side: int, random: Generator) -> Tensor:
    """Voronoi cells, each of one grey, with borders soft or sharp."""
    at = _positions(side, random).view(-1, 2)
    pictures: list[Tensor] = []
    for _ in range(count):
        number = int(log_uniform(1, 20, 400, random))
        seeds = torch.rand(number, 2, generator=random, device=random.device) * side
        greys = torch.rand(number, generator=random, device=random.device)
        near, which = torch.cdist(at, seeds).topk(2, largest=False)
        softness = log_uniform(1, 0.3, 3, random).item()
        share = torch.sigmoid((near[:, 1] - near[:, 0]) / softness)
        grey = greys[which]
        pictures.append((share * grey[:, 0] + (1 - share) * grey[:, 1]).view(side, side))
    return torch.stack(pictures)


def strokes(count: int, side: int, random: Generator) -> Tensor:
    """Ellipses laid over each other: blobs to brush strokes, with a common direction or none."""
    at = _positions(side, random)
    picture = smooth(count, side, 40.0, random)
    common, spread = uniform(count, 0, pi, random), uniform(count, 0, 2, random)
    size, longer = log_uniform(count, 2, 12, random), log_uniform(count, 1, 6, random)
    for _ in range(160):
        right = at[..., 0] - uniform(count, 0, side, random)
        down = at[..., 1] - uniform(count, 0, side, random)
        angle = common + spread * uniform(count, -1, 1, random)
        along = (right * angle.cos() + down * angle.sin()) / (size * longer)
        across = (down * angle.cos() - right * angle.sin()) / size
        opacity = torch.sigmoid(4 * size * (1 - (along.square() + across.square()).sqrt()))
        picture = torch.lerp(picture, uniform(count, -2, 2, random).expand_as(opacity), opacity)
    return picture


def waves(count: int, side: int, random: Generator) -> Tensor:
    """Gratings and rings bent by noise, as marble or finger prints."""
    at = _positions(side, random)
    angle, wavelength = uniform(count, 0, 2 * pi, random), log_uniform(count, 5, 30, random)
    phase = at[..., 0] * angle.cos() + at[..., 1] * angle.sin()
    bent = uniform(count, 3, 30, random) * smooth(
        count, side, log_uniform(count, 24, 80, random), random
    )
    return torch.sin(2 * pi * (phase + bent) / wavelength) * torch.exp(
        uniform(count, 0, 1, random) * smooth(count, side, 24.0, random)
    )


def photographs(count: int, side: int, random: Generator) -> Tensor:
    """Parts of `PHOTOGRAPHS`, shrunk by up to three.

    Raises:
        BackendUnavailableError: If scikit-image is not installed.
    """
    greys = _greys()
    return torch.stack([cut(greys[i % len(greys)], side, random) for i in range(count)])


def cut(picture: Float[Tensor, "r c"], side: int, random: Generator) -> Float[Tensor, "s s"]:
    """A square part of a picture, from all of it down to `side` pixels (a third at least)."""
    shortest = min(picture.shape)
    shrink = min(log_uniform(1, 1, 3, random).item(), shortest / side)
    width = min(round(side * shrink), shortest)
    top, left = (int(uniform(1, 0, length - width + 0.999, random)) for length in picture.shape)
    part = picture[top : top + width, left : left + width].to(random.device)
    return functional.interpolate(
        part[None, None], size=(side, side), mode="bilinear", antialias=True, align_corners=False
    )[0, 0]


KINDS: Mapping[Kind, int] = {
    spectral: 6, shaped: 6, cells: 2, strokes: 4, waves: 2, photographs: 4,
}  # fmt: skip
"""What the network is trained on, and in what proportion."""


def bank(
    kinds: Mapping[Kind, int], count: int, side: int, random: Generator
) -> Float[Tensor, "n side side"]:
    """About `count` textures of zero mean and unit variance.

    Args:
        kinds: And the proportion of each.
        count: Rounded to what the proportions allow.
        side: Pixels.
        random: Decides the device too.

    Raises:
        BackendUnavailableError: If scikit-image is needed and not installed.
    """
    parts: list[Tensor] = []
    for kind, share in kinds.items():
        wanted = max(1, round(count * share / sum(kinds.values())))
        starts = range(0, wanted, 32)
        parts.extend(kind(min(32, wanted - start), side, random) for start in starts)
    textures = torch.cat(parts)
    textures = textures - textures.mean(dim=(1, 2), keepdim=True)
    return textures / textures.std(dim=(1, 2), keepdim=True).clamp(min=1e-6)


@cache
def _greys() -> list[Tensor]:
    """`PHOTOGRAPHS`, 0–1."""
    try:
        data = importlib.import_module("skimage.data")
    except ImportError as error:
        raise BackendUnavailableError(
            "textures: scikit-image, which holds the photographs, is missing: "
            "pip install scikit-image"
        ) from error
    greys: list[Tensor] = []
    for name in PHOTOGRAPHS:
        picture = torch.from_numpy(getattr(data, name)()).float() / 255
        greys.append(picture.mean(dim=-1) if picture.ndim == 3 else picture)
    return greys


def _positions(side: int, random: Generator) -> Tensor:
    """Of pixel centres, `[row, column, (right, down)]`."""
    along = torch.arange(side, dtype=torch.float32, device=random.device) + 0.5
    return torch.stack(torch.meshgrid(along, along, indexing="xy"), dim=-1)


def _frequencies(side: int, random: Generator) -> tuple[Tensor, Tensor]:
    """Cycles a pixel, and their direction, as `rfft2` orders them."""
    down = torch.fft.fftfreq(side, device=random.device)[:, None]
    right = torch.fft.rfftfreq(side, device=random.device)
    return torch.hypot(down, right), torch.atan2(down, right.expand(side, -1))


def _filtered(amplitude: Tensor, random: Generator, count: int) -> Tensor:
    """White noise with the given spectrum; zero mean, unit variance."""
    side = amplitude.shape[-2]
    noise = torch.randn(count, side, side, generator=random, device=random.device)
    spectrum = torch.fft.rfft2(noise) * amplitude
    spectrum[:, 0, 0] = 0
    picture = torch.fft.irfft2(spectrum, s=(side, side))
    return picture / picture.std(dim=(1, 2), keepdim=True).clamp(min=1e-9)
