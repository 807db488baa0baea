"""`vnca demo`: from nothing to a film of painted smoke."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from pathlib import Path

from vnca.cli.film import FilmConfig
from vnca.cli.options import parse, say
from vnca.cli.render import Render, strip
from vnca.cli.sequence import open_sequence
from vnca.cli.simulate import Simulate, write_simulation
from vnca.cli.stylize import Stylize, paint
from vnca.cli.train import Train, train
from vnca.io.image import fit, read_style, write_image
from vnca.io.sheet import contact_sheet
from vnca.training.config import PRESETS, TrainConfig
from vnca.typing import FloatArray

STYLE = "vangogh_cafe_terrace.webp"
"""A painting in the package, in the public domain."""

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
        write_simulation(Simulate("plume", smoke, resolution, frames, options.seed))
        trained = smoke / f"plume_{3 * frames // 4:04d}.vdb"
        train(
            Train(
                trained,
                style,
                out=run_folder,
                overwrite=True,
                texture=1.0 if options.quick else None,
                config=_config(options),
            )
        )
        sequence = str(smoke / "plume_####.vdb")
        asked = f"{frames // 4}-{frames}"
        refine = 1 if options.quick else 2
        paint(Stylize(run_folder, sequence, painted, frames=asked, preview=film, refine=refine))
        view = FilmConfig(rows=SHEET_SIZE, columns=SHEET_SIZE)
        shown = Render(str(painted), sheet, frames=asked, film=view)
        write_image(sheet, _sheet(picture, shown))
    minutes, seconds = divmod(round(time.monotonic() - start), 60)
    say(f"done in {minutes}:{seconds:02}")
    print(f"film:          {film}\ncontact sheet: {sheet}")


def _config(options: Demo) -> TrainConfig:
    config = replace(PRESETS["draft"], seed=options.seed)
    if not options.quick:
        return config
    return replace(
        config,
        iterations=60,
        view=replace(config.view, size=96),
        rule=replace(config.rule, hidden=64),
        longest_rollout=24,
    )


def _sheet(style: FloatArray, options: Render) -> FloatArray:
    """The style and four frames of the painting, side by side."""
    frames = strip(open_sequence(options.sequence, options.frames), options, 4)
    return contact_sheet([[fit(style, SHEET_SIZE, SHEET_SIZE), *frames]])
