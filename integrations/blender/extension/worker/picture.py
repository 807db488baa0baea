# SPDX-License-Identifier: GPL-3.0-or-later
"""A quick picture of a painted frame: from the front, glowing, with light from above.

Strength and mask are taken into it as the material takes them.
"""

import os
from pathlib import Path

import numpy as np
from PIL import Image

import vnca
from vnca.io.picture import to_srgb8

SIZE = 256
"""Pixels of the longer side, at most."""
BACKGROUND = 0.012
MARGIN = 0.06
"""Seen around the smoke, of its longest side."""
AMBIENT = 0.45
SHADE = 0.25
"""Part of the optical depth above that shades a cell: light is scattered many times."""


UNPAINTED = "unpainted"
"""The grid of the density as it was."""
VELOCITIES = ("velocity", "vel", "v")
"""Names of the velocity, as one grid of vectors."""


def facts(path):
    """What the file tells of its painting: its extinction, and its velocity with units."""
    with vnca.open_vdb(path) as file:
        told = {"extinction": float(file.metadata["vnca_extinction"].value)}
        told["keeps"] = UNPAINTED in file.grids
        names = [name for name in file.grids if name.lower() in VELOCITIES]
        if names:
            velocity = file.grids[names[0]]
            told["velocity"] = names[0]
            told["voxel"] = velocity.transform.voxel_size[0]
            told["units"] = velocity.metadata.value("velocity_units", "")
    return told


def draw(path, out, *, strength, mask):
    """Draw a frame into a PNG file, which appears whole.

    Args:
        path: The painted frame.
        out: The picture.
        strength: Of the colour, from 0 to 1.
        mask: As `scene.mask.shape_of` tells of it.
    """
    with vnca.open_vdb(path) as file:
        density = file.read("density")
        box = density.active_box()
        if box.is_empty:
            pixels = np.full((SIZE, SIZE, 3), BACKGROUND)
        else:
            around = max(round(MARGIN * max(box.shape)), 1)
            pixels = _seen(*_shown(file, density, box.grown(around), strength, mask))
    image = Image.fromarray(to_srgb8(pixels))
    scale = SIZE / max(image.size)
    size = [max(round(side * scale), 1) for side in image.size]
    temporary = Path(out).with_suffix(".part")
    image.resize(size, Image.Resampling.BICUBIC).save(temporary, format="PNG")
    os.replace(temporary, out)


def fold(sheet, out):
    """Lay a row of square pictures out as a square of four, which a panel shows larger.

    Args:
        sheet: The row: the picture that is learned, and views of what was learned of it.
        out: A PNG file, which appears whole.
    """
    with Image.open(sheet) as row:
        row.load()
        count, high = round(row.width / row.height), row.height
        if count >= 4:
            wide = row.width // count
            tiles = [row.crop((wide * at, 0, wide * (at + 1), high)) for at in range(4)]
            row = Image.new("RGB", (2 * wide, 2 * high))
            for at, tile in enumerate(tiles):
                row.paste(tile, (wide * (at % 2), high * (at // 2)))
        temporary = Path(out).with_suffix(".part")
        row.save(temporary, format="PNG")
    os.replace(temporary, out)


def _shown(file, density, box, strength, mask):
    """Optical depth `[x, y, z]` and colour `[x, y, z, 3]` of cells, z up."""
    extinction = float(file.metadata["vnca_extinction"].value)
    colour = file.read("Cd").to_dense(box)[0].astype(np.float32)
    thick = density.to_dense(box)[0].astype(np.float32)
    part = _part(file, density, box, mask)
    if UNPAINTED in file.grids and mask["kind"] != "NONE":
        before = _nearest(file.read(UNPAINTED), density, box)
        thick = before + part * (thick - before)
    colour = 1 + strength * part[..., None] * (colour - 1)
    depth = thick * extinction * density.transform.voxel_size[0]
    return _upright(depth, colour, file.metadata["vnca_up_axis"].value)


def _part(file, density, box, mask):
    """How much of the painting shows, from 0 to 1, cell by cell."""
    if mask["kind"] == "NONE":
        return np.ones(box.shape, np.float32)
    if mask["kind"] == "GRID":
        if mask["grid"] not in file.grids:
            return np.zeros(box.shape, np.float32)
        return np.clip(_nearest(file.read(mask["grid"]), density, box), 0, 1)
    to_shape = np.array(mask["matrix"]) @ density.transform.index_to_world
    away = _cells(box) @ to_shape[:3, :3].T + to_shape[:3, 3]
    far = abs(away).max(-1) if mask["kind"] == "BOX" else np.linalg.norm(away, axis=-1)
    return (far <= 1).astype(np.float32)


def _nearest(grid, density, box):
    """Values of a grid at the nearest of its cells to those of the density."""
    own = grid.active_box()
    if own.is_empty:
        return np.zeros(box.shape, np.float32)
    values = grid.to_dense(own)[0].astype(np.float32)
    across = np.linalg.inv(grid.transform.index_to_world) @ density.transform.index_to_world
    at = np.rint(_cells(box) @ across[:3, :3].T + across[:3, 3]).astype(int) - own.lower
    held = ((at >= 0) & (at < own.shape)).all(-1)
    return np.where(held, values[tuple(np.moveaxis(np.where(held[..., None], at, 0), -1, 0))], 0)


def _cells(box):
    return np.stack(np.indices(box.shape), -1) + np.array(box.lower)


def _upright(depth, colour, up):
    """With z up; ours is (x, y, z) = the file's (z, x, y) where y is up there."""
    if up == "y":
        return depth.transpose(2, 0, 1), colour.transpose(2, 0, 1, 3)
    return depth, colour


def _seen(depth, colour):
    """Linear RGB `[row, column, 3]`, along +y."""
    above = np.cumsum(depth[:, :, ::-1], axis=2)[:, :, ::-1] - depth
    light = AMBIENT + (1 - AMBIENT) * np.exp(-SHADE * above)
    near = np.cumsum(depth, axis=1) - depth
    weight = np.exp(-near) * (1 - np.exp(-depth))
    seen = ((weight * light)[..., None] * np.maximum(colour, 0)).sum(axis=1)
    through = np.exp(-depth.sum(axis=1))
    picture = seen + BACKGROUND * through[..., None]
    return picture.transpose(1, 0, 2)[::-1]
