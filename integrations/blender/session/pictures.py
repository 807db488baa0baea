# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the pictures of the guide from what a session left.

`python pictures.py FOLDER WINDOW LIT OUT`, with a Python that has vnca. FOLDER is that of
`paint.py`, WINDOW that of `window.py`, LIT where `test_light.py` left its picture (VNCA_KEEP), OUT
where they go: `docs/images`.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from vnca.io.picture import to_srgb8

GAP = 4
CHOICES, WORK, TRAINING = (600, 82, 900, 490), (600, 490, 900, 898), (600, 550, 900, 955)
"""In a window of 900 columns: halves of the panel, and what is said of a training."""
SOLID = 0.95
"""Opacity from which on a pixel counts for the exposure."""


def beside(images: list[Image.Image]) -> Image.Image:
    """Pictures of one height, on white."""
    width = sum(image.width for image in images) + GAP * (len(images) - 1)
    sheet, at = Image.new("RGB", (width, images[0].height), "white"), 0
    for image in images:
        sheet.paste(image, (at, 0))
        at += image.width + GAP
    return sheet


def opened(path: Path, rows: int = 0) -> Image.Image:
    """A picture, as high as is asked."""
    image = Image.open(path).convert("RGB")
    if not rows:
        return image
    return image.resize((round(image.width * rows / image.height), rows), Image.Resampling.LANCZOS)


def lit(path: Path) -> Image.Image:
    """Two linear views side by side, in Cycles and in our film, with one exposure for both."""
    views = np.split(np.load(path), 2, axis=1)
    solid = np.minimum(*(view[..., 3] for view in views)) > SOLID
    theirs, ours = (view[solid][:, :3] for view in views)
    views[0] = views[0] * ((theirs * ours).sum() / (theirs**2).sum())
    image = Image.fromarray(to_srgb8(np.concatenate(views, axis=1)[..., :3]))
    return image.resize((8 * image.width, 8 * image.height), Image.Resampling.NEAREST)


def main(folder: Path, window: Path, light: Path, out: Path) -> None:
    """Write them."""
    rendered = [opened(path) for path in sorted(folder.glob("lit_*.png"))]
    preview = opened(folder / "preview.png", rendered[0].height)
    beside([*rendered, preview]).save(out / "blender_session.webp", quality=88, method=6)
    panel = opened(window / "panel.png")
    beside([panel.crop(CHOICES), panel.crop(WORK)]).save(
        out / "blender_panel.webp", quality=88, method=6
    )
    training = opened(window / "training.png").crop(TRAINING)
    training.save(out / "blender_training.webp", quality=88, method=6)
    lit(light / "cafe.npy").save(out / "blender_light.webp", quality=80, method=6)


main(*map(Path, sys.argv[1:5]))
