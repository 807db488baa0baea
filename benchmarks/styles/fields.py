"""Noise, warping, light and colour: what surfaces are made of.

Everything repeats after one side of the picture, so that no picture has a seam. Lengths are
fractions of the side, colours sRGB in [0, 1], fields of shape [rows, columns].
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy.ndimage import map_coordinates

Field = NDArray[np.floating[Any]]


def frequency(n: int) -> Field:
    """How many waves fit the side, for each coefficient of `rfft2`."""
    return np.hypot(np.fft.fftfreq(n, 1 / n)[:, None], np.fft.rfftfreq(n, 1 / n)).astype(np.float32)


def filtered(field: Field, response: Field) -> Field:
    waves = np.asarray(fft.rfft2(field)) * response
    return np.asarray(fft.irfft2(waves, s=field.shape), np.float32)


def blurred(field: Field, length: float) -> Field:
    """Gaussian of that standard deviation."""
    return filtered(field, np.exp(-2 * (np.pi * length * frequency(len(field))) ** 2))


def noise(rng: Generator, n: int, length: float, roughness: float = 0) -> Field:
    """Noise of mean 0 and deviation 1, smooth over `length`; roughness up to 1 adds finer grain."""
    waves = frequency(n) * length
    response = (1 + waves**2) ** (roughness - 2) if roughness else np.exp(-(waves**2))
    response[0, 0] = 0
    field = filtered(rng.standard_normal((n, n), np.float32), response)
    return field / field.std()


def places(n: int) -> tuple[Field, Field]:
    """X and y of every pixel."""
    y, x = np.mgrid[:n, :n].astype(np.float32) / n
    return x, y


def at(field: Field, x: ArrayLike, y: ArrayLike) -> Field:
    """The field there, interpolated."""
    n = len(field)
    where = np.stack([np.asarray(y), np.asarray(x)]) * n
    return map_coordinates(field, where, order=1, mode="grid-wrap")


def slope(field: Field) -> tuple[Field, Field]:
    """Change along x and along y, per side."""
    n = len(field) / 2
    along_x = (np.roll(field, -1, 1) - np.roll(field, 1, 1)) * n
    return along_x, (np.roll(field, -1, 0) - np.roll(field, 1, 0)) * n


def currents(rng: Generator, n: int, length: float) -> tuple[Field, Field]:
    """A flow without sources, of root mean square speed 1."""
    along_x, along_y = slope(noise(rng, n, length))
    scale = np.sqrt((along_x**2 + along_y**2).mean())
    return along_y / scale, -along_x / scale


def stirred(
    rng: Generator, n: int, length: float, far: float, steps: int = 12
) -> tuple[Field, Field]:
    """Where each pixel comes from when water of such eddies has moved it so far."""
    (x, y), (u, v) = places(n), currents(rng, n, length)
    for _ in range(steps):
        dx, dy = at(u, x, y), at(v, x, y)
        x, y = x - far / steps * dx, y - far / steps * dy
    return x, y


def smooth(field: ArrayLike, low: float, high: float) -> Field:
    """0 below `low`, 1 above `high`, smoothly between."""
    t = np.clip((np.asarray(field, np.float32) - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def ramp(t: ArrayLike, colours: Sequence[str]) -> Field:
    """Colours along [0, 1], evenly spaced: [..., 3]."""
    table, t = np.array([colour(c) for c in colours]), np.clip(t, 0, 1)
    stops = np.linspace(0, 1, len(table))
    return np.stack([np.interp(t, stops, c) for c in table.T], -1).astype(np.float32)


def colour(name: str) -> Field:
    """Of six hexadecimal digits: [3]."""
    return np.array([int(name[i : i + 2], 16) / 255 for i in (0, 2, 4)], np.float32)


def mix(below: Field, above: ArrayLike, share: Field) -> Field:
    share = share[..., None]
    return below * (1 - share) + np.asarray(above, np.float32) * share


def light(height: Field, strength: float) -> Field:
    """What a lamp at the upper left adds to a surface of that height: about -1 to 1."""
    along_x, along_y = slope(height)
    return np.tanh(-strength * (along_x + along_y))
