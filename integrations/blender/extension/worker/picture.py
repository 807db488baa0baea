# SPDX-License-Identifier: GPL-3.0-or-later
"""A quick picture of a painted frame: from the front, glowing, with light from above."""

import os
from pathlib import Path

import numpy as np
from PIL import Image

import vnca
from vnca.io.picture import to_srgb8

SIZE = 256
"""Pixels of the longer side, at most."""
BACKGROUND = 0.012
AMBIENT = 0.45
SHADE = 0.25
"""Part of the optical depth above that shades a cell: light is scattered many times."""


VELOCITIES = ("velocity", "vel", "v")
"""Names of the velocity, as one grid of vectors."""


def facts(path):
    """What the file tells of its painting: its extinction, and its velocity with units."""
    with vnca.open_vdb(path) as file:
        told = {"extinction": float(file.metadata["vnca_extinction"].value)}
        names = [name for name in file.grids if name.lower() in VELOCITIES]
        if names:
            velocity = file.grids[names[0]]
            told["velocity"] = names[0]
            told["voxel"] = velocity.transform.voxel_size[0]
            told["units"] = velocity.metadata.value("velocity_units", "")
    return told


def draw(path, out):
    """Draw a frame into a PNG file, which appears whole."""
    with vnca.open_vdb(path) as file:
        up = file.metadata["vnca_up_axis"].value
        extinction = float(file.metadata["vnca_extinction"].value)
        density = file.read("density")
        box = density.active_box()
        if box.is_empty:
            pixels = np.full((SIZE, SIZE, 3), BACKGROUND)
        else:
            colour = file.read("Cd").to_dense(box)[0].astype(np.float32)
            thick = density.to_dense(box)[0].astype(np.float32)
            depth = thick * extinction * density.transform.voxel_size[0]
            pixels = _seen(*_upright(depth, colour, up))
    image = Image.fromarray(to_srgb8(pixels))
    scale = SIZE / max(image.size)
    size = [max(round(side * scale), 1) for side in image.size]
    temporary = Path(out).with_suffix(".part")
    image.resize(size, Image.Resampling.BICUBIC).save(temporary, format="PNG")
    os.replace(temporary, out)


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
