"""`vnca demo`: from nothing to a film of painted smoke."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from pathlib import Path

from vnca.cli.options import parse
from vnca.cli.terminal import Terminal, say
from vnca.core import FloatArray
from vnca.io.film import contact_sheet
from vnca.io.picture import fit, read_style, write_image
from vnca.recipe import Watch
from vnca.recipe.film import FilmConfig
from vnca.recipe.rendering import RenderRun, strip
from vnca.recipe.sequence import open_sequence
from vnca.recipe.simulation import simulate
from vnca.recipe.smoke import SmokeRun
from vnca.recipe.smoke import run as train
from vnca.recipe.stylizing import stylize
from vnca.training.config import SmokeConfig
from vnca.training.presets import DEFAULT, preset

STYLE = "rust.webp"
"""A picture in the package that no style of its library has learned."""

SHEET_SIZE = 256
"""Rows and columns of a picture on the contact sheet, pixels."""


@dataclass(frozen=True)
class Demo:
    """Simulate a plume, learn a painting on one frame of it, paint all frames and film them."""

    out: Path = Path("demo")
    """Folder for everything the demo makes."""
    quick: bool = False
    """Small and rough, in a fraction of the time."""
    style: Path | None = None
    """Another picture to learn from."""
    seed: int = 0
    """Same seed, same machine, same film."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and show what vnca does."""
    demonstrate(parse("demo", Demo, arguments))


def demonstrate(options: Demo) -> None:
    """Make the demo's smoke, model, painting, film and contact sheet.

    Raises:
        VncaError: If the folder cannot be written.
    """
    start = time.monotonic()
    resolution, frames = (28, 24) if options.quick else (48, 40)
    smoke, run_folder, painted = (options.out / name for name in ("smoke", "run", "painted"))
    film, sheet = options.out / "demo.mp4", options.out / "demo.png"
    with as_file(files("vnca.data") / STYLE) as own:
        style = options.style or own
        picture = read_style(style)
        watch = Terminal()
        scene = simulate(
            "plume", out=smoke, resolution=resolution, frames=frames, seed=options.seed, watch=watch
        )
        for _ in scene:
            pass
        asked = SmokeRun(
            frame=smoke / f"plume_{3 * frames // 4:04d}.vdb",
            style=style,
            out=run_folder,
            overwrite=True,
            device=options.device,
            config=_config(options),
        )
        train(asked, watch)
        shown = f"{frames // 4}-{frames}"
        painting = stylize(
            run_folder,
            smoke / "plume_####.vdb",
            out=painted,
            frames=shown,
            preview=film,
            overwrite=True,
            refine=1 if options.quick else 2,
            device=options.device,
            watch=watch,
        )
        for _ in painting:
            pass
        view = FilmConfig(rows=SHEET_SIZE, columns=SHEET_SIZE)
        seen = RenderRun(
            sequence=str(painted), out=sheet, frames=shown, device=options.device, film=view
        )
        write_image(sheet, _sheet(picture, seen, watch))
    minutes, seconds = divmod(round(time.monotonic() - start), 60)
    say(f"done in {minutes}:{seconds:02}")
    print(f"film:          {film}\ncontact sheet: {sheet}")


def _config(options: Demo) -> SmokeConfig:
    config = replace(preset(SmokeConfig, DEFAULT), seed=options.seed)
    iterations = 15 if options.quick else 100
    return replace(config, iterations=iterations, texture=2.0)


def _sheet(style: FloatArray, options: RenderRun, watch: Watch) -> FloatArray:
    """The style and four frames of the painting, side by side."""
    frames = strip(open_sequence(options.sequence, options.frames, watch), options, 4)
    return contact_sheet([[fit(style, SHEET_SIZE, SHEET_SIZE), *frames]])
