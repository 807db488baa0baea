"""Makes the smoke half of the gallery: a film for each style of the library and each scene.

    python docs/gallery/smoke.py WORK [STYLE ...]

Simulates a plume, a ring and jets, none of which any of the styles saw in training; paints and
films them in all styles, or those named. What is in the folder WORK already is not made again.
Films, with fewer bytes, go to `smoke/`, beside this file, each picture with them, small.
"""

import sys
from importlib.resources import as_file, files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageSequence
from workshop import HERE, made

from vnca.core.colour import srgb_to_linear
from vnca.io.picture import fit, write_image
from vnca.recipe.film import FilmConfig
from vnca.rule.library import SUFFIX, load_style, style_names

FILMS = HERE / "smoke"
QUALITY = 75
"""Of a film as a page shows it, as WebP counts: half as large as `vnca render` writes them."""
THUMBNAIL = 200
"""Rows and columns of the picture beside its films."""
FILM = ("--rows", 240, "--columns", 240, "--film-fps", 12)


class Scene(NamedTuple):
    """A simulation, and how it is painted and shown."""

    cells: int
    frames: int
    refine: int
    light: float


SCENES = {
    "plume": Scene(cells=64, frames=40, refine=2, light=0.0),
    "ring": Scene(cells=64, frames=40, refine=2, light=FilmConfig.light),
    "jets": Scene(cells=128, frames=40, refine=1, light=FilmConfig.light),
}


def main(folder: str, *styles: str) -> None:
    """Make what is missing."""
    work = Path(folder)
    for sub in (work, FILMS):
        sub.mkdir(parents=True, exist_ok=True)
    for name, scene in SCENES.items():
        last = work / name / f"{name}_{scene.frames:04d}.vdb"
        size = ("--resolution", scene.cells, "--frames", scene.frames)
        made(last, "simulate", name, "--out", work / name, *size)
    for style in styles or style_names():
        films_of(style, work)


def films_of(style: str, work: Path) -> None:
    """Paint and film all scenes in a style."""
    picture = load_style(style).style
    assert picture is not None, "a style of the library has its picture"
    write_image(
        FILMS / f"{style}.webp",
        fit(srgb_to_linear(picture / np.float32(255)), THUMBNAIL, THUMBNAIL),
    )
    with as_file(files("vnca.data") / "styles" / (style + SUFFIX)) as model:
        for name, scene in SCENES.items():
            painted, film = work / f"{style}_{name}", work / f"{style}_{name}.webp"
            last = painted / f"{name}_{scene.frames:04d}.vdb"
            how = ("--refine", scene.refine, "--resume", "--overwrite")
            made(last, "stylize", model, work / name, "--out", painted, *how)
            shown = ("--frames", f"{scene.frames // 4}-{scene.frames}", "--light", scene.light)
            made(film, "render", painted, "--out", film, *FILM, *shown)
            lighten(film, FILMS / film.name)


def lighten(film: Path, out: Path) -> None:
    """A film in fewer bytes."""
    with Image.open(film) as given:
        first, *others = (frame.convert("RGB") for frame in ImageSequence.Iterator(given))
        pace = given.info["duration"]  # known once a frame was read
    how = {"quality": QUALITY, "method": 6, "loop": 0, "duration": pace}
    first.save(out, "WEBP", save_all=True, append_images=others, **how)


if __name__ == "__main__":
    main(*sys.argv[1:])
