"""Draws five pictures to paint with, seeded: ours, so that anyone may use and copy them.

    python docs/gallery/pictures.py FOLDER

All of them tile. They hold what a texture can: lines, cells and strokes of a few sizes.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from vnca.core import AnyArray
from vnca.core.colour import srgb_to_linear
from vnca.io.picture import write_image

SIZE = 512
WORK = 2 * SIZE
"""Drawn at twice the size, then averaged: no jagged edges."""


def noise(generator: np.random.Generator, scale: float, roughness: float = 0.0) -> AnyArray:
    """Smooth noise `[WORK, WORK]` of variance 1 that tiles; `scale` is a bump's size in pixels."""
    frequency = np.fft.fftfreq(WORK) * WORK
    radius = np.hypot(frequency[:, None], frequency) * scale / WORK
    spectrum = np.exp(-2 * radius**2) + roughness / (1 + radius**2)
    spectrum[0, 0] = 0
    field = np.fft.ifft2(np.fft.fft2(generator.normal(size=(WORK, WORK))) * spectrum).real
    return field / field.std()


def warped(picture: AnyArray, down: AnyArray, right: AnyArray) -> AnyArray:
    """A picture read at displaced pixels."""
    rows, columns = np.indices((WORK, WORK), float)
    return map_coordinates(picture, [rows + down, columns + right], order=1, mode="grid-wrap")


def cells(generator: np.random.Generator, count: int) -> tuple[AnyArray, AnyArray]:
    """Cells around random points: which one a pixel is in, and how far it is from the border."""
    points = generator.uniform(0, WORK, (count, 2))
    rows, columns = np.indices((WORK, WORK), np.float32)
    nearest = np.full((WORK, WORK), np.inf, np.float32)
    second = nearest.copy()
    owner = np.zeros((WORK, WORK), np.int64)
    for index, (row, column) in enumerate(points):
        down = np.abs(rows - row)
        right = np.abs(columns - column)
        distance = np.hypot(np.minimum(down, WORK - down), np.minimum(right, WORK - right))
        closer = distance < nearest
        second = np.where(closer, nearest, np.minimum(second, distance))
        nearest = np.where(closer, distance, nearest)
        owner[closer] = index
    return owner, second - nearest


def palette(value: AnyArray, *colours: str) -> AnyArray:
    """Colours (hexadecimal) blended along a value from 0 to 1, `[r, c, 3]`, display-referred."""
    stops = np.array([[int(colour[i : i + 2], 16) / 255 for i in (0, 2, 4)] for colour in colours])
    places = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(value, places, stops[:, channel]) for channel in range(3)], -1)


def combed(
    generator: np.random.Generator, along: AnyArray, *, width: float, length: int
) -> AnyArray:
    """White noise drawn out along a direction (radians), as bristles draw paint; 0 to 1."""
    stroke = gaussian_filter(generator.normal(size=(WORK, WORK)), width, mode="wrap")
    total = stroke.copy()
    for sign in (-1, 1):
        rows, columns = np.indices((WORK, WORK), float)
        for _ in range(length):
            here = [rows, columns]
            angle = np.arctan2(
                map_coordinates(np.sin(along), here, order=1, mode="grid-wrap"),
                map_coordinates(np.cos(along), here, order=1, mode="grid-wrap"),
            )
            rows, columns = rows + 3 * sign * np.sin(angle), columns + 3 * sign * np.cos(angle)
            total += map_coordinates(stroke, [rows, columns], order=1, mode="grid-wrap")
    ranks = np.argsort(np.argsort(total, axis=None))
    return ranks.reshape(total.shape) / total.size


def gilded_cells(generator: np.random.Generator) -> AnyArray:
    """Thin gold walls between dark cells."""
    _, edge = cells(generator, 46)
    bend = noise(generator, 160), noise(generator, 160)
    edge = warped(edge, 26 * bend[0], 26 * bend[1])
    wall = np.exp(-((edge / 13) ** 2)) + 0.35 * np.exp(-edge / 40)
    glow = 0.75 + 0.25 * noise(generator, 140)
    value = np.clip(wall * glow, 0, 1) ** 1.2
    return palette(value, "0d0a12", "3a2412", "a06a1c", "f2c14e", "fff3c4")


def marbled_paper(generator: np.random.Generator) -> AnyArray:
    """Bands of ink floated on water and combed."""
    rows, _ = np.indices((WORK, WORK), float)
    height = 95 * noise(generator, 260) + 45 * noise(generator, 110)
    bands = np.sin(2 * np.pi * (rows * 5 / WORK + height / 130))
    veins = np.abs(np.sin(2 * np.pi * (rows * 11 / WORK + height / 60)))
    value = np.clip(0.5 + 0.45 * bands + 0.05 * noise(generator, 40), 0, 1)
    picture = palette(value, "14213d", "1f4e79", "5aa9b5", "f4ead5", "e9b872", "b23a48", "6b1a2b")
    vein = np.clip(1 - veins / 0.16, 0, 1)[..., None]
    return picture * (1 - 0.8 * vein) + 0.8 * vein * np.array([0.98, 0.94, 0.84])


def stained_glass(generator: np.random.Generator) -> AnyArray:
    """Panes of bright glass in lead."""
    owner, edge = cells(generator, 60)
    hue = generator.uniform(0, 1, 60)[owner]
    bend = noise(generator, 200)
    hue, edge = (warped(field, 14 * bend, -14 * bend) for field in (hue, edge))
    panes = palette(hue, "0b3c8c", "1487c9", "13a89e", "e8c51c", "ee7c1b", "c81d25", "5b1a75")
    panes *= (0.85 + 0.13 * noise(generator, 30))[..., None]
    lead = 1 / (1 + np.exp((edge - 13) / 2.5))[..., None]
    return panes * (1 - lead) + lead * np.array([0.05, 0.05, 0.07])


def ink_waves(generator: np.random.Generator) -> AnyArray:
    """Indigo lines on paper that flow around each other."""
    rows, columns = np.indices((WORK, WORK), float)
    height = 120 * noise(generator, 300)
    phase = 2 * np.pi * (rows * 8 + columns * 3) / WORK + height / 26
    width = 0.3 + 0.3 * (0.5 + 0.5 * np.tanh(1.4 * noise(generator, 150)))
    line = 1 / (1 + np.exp((np.sin(phase) + 1 - 2 * width) / 0.12))
    wash = np.clip(0.5 + 0.3 * noise(generator, 120), 0, 1)
    paper = palette(wash, "f6efe0", "efe3c8", "b9d2d6")
    ink = palette(wash, "0f2a4a", "12355b", "1f5f8b")
    return paper * (1 - line[..., None]) + ink * line[..., None]


def ember_strokes(generator: np.random.Generator) -> AnyArray:
    """Thick strokes of fire that whirl."""
    height = noise(generator, 320)
    down, right = np.gradient(height)
    strokes = combed(generator, np.arctan2(right, -down), width=7, length=40)
    heat = 0.5 + 0.1 * warped(noise(generator, 240), 40 * height, 40 * height)
    value = np.clip(heat + 0.95 * (strokes - 0.5), 0, 1)
    return palette(value, "12061f", "3d0c4a", "9b1d3a", "e4572e", "ffb627", "fff1b8")


PICTURES: dict[str, Callable[[np.random.Generator], AnyArray]] = {
    "gilded_cells": gilded_cells,
    "marbled_paper": marbled_paper,
    "stained_glass": stained_glass,
    "ink_waves": ink_waves,
    "ember_strokes": ember_strokes,
}


def main(folder: str) -> None:
    """Write the pictures."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for seed, (name, draw) in enumerate(PICTURES.items()):
        drawn = np.clip(draw(np.random.default_rng(seed)), 0, 1)
        picture = drawn.reshape(SIZE, 2, SIZE, 2, 3).mean((1, 3))
        write_image(Path(folder) / f"{name}.png", srgb_to_linear(picture.astype(np.float32)))


if __name__ == "__main__":
    main(sys.argv[1])
