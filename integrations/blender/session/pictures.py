# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the pictures of the guide from what a session left: `python pictures.py FOLDER WINDOW OUT`.

FOLDER is that of `paint.py`, WINDOW that of `window.py`, OUT where they go: `docs/images`.
"""

import sys
from pathlib import Path

from PIL import Image

GAP = 4
CHOICES, WORK, TRAINING = (600, 82, 900, 490), (600, 490, 900, 898), (600, 510, 900, 915)
"""In a window of 900 columns: halves of the panel, and what is said of a training."""


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


def main(folder: Path, window: Path, out: Path) -> None:
    """Write them."""
    lit = [opened(path) for path in sorted(folder.glob("lit_*.png"))]
    preview = opened(folder / "preview.png", lit[0].height)
    beside([*lit, preview]).save(out / "blender_session.webp", quality=88, method=6)
    panel = opened(window / "panel.png")
    beside([panel.crop(CHOICES), panel.crop(WORK)]).save(
        out / "blender_panel.webp", quality=88, method=6
    )
    training = opened(window / "training.png").crop(TRAINING)
    training.save(out / "blender_training.webp", quality=88, method=6)


main(*map(Path, sys.argv[1:4]))
