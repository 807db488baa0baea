"""`vnca stylize MODEL SEQUENCE --out DIR`."""

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from vnca.automaton.model import Model
from vnca.cli.film import Film, FilmConfig
from vnca.cli.options import parse, say
from vnca.cli.progress import tracked
from vnca.errors import OptionError, SequenceError
from vnca.io.sequence import Frames, find_frames
from vnca.io.smoke import SmokeFormat, read_smoke, smoke_box, write_painted
from vnca.kernels.update import stepper
from vnca.stylize.ahead import read_ahead
from vnca.stylize.config import StylizeConfig
from vnca.stylize.roll import Painting, stylize
from vnca.typing import Box


@dataclass(frozen=True)
class Stylize:
    """Paint a smoke sequence with a trained rule."""

    model: tyro.conf.Positional[Path]
    """A model file, or the folder of a training run."""
    sequence: tyro.conf.Positional[Path]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    out: Path
    """Folder for the painted frames, which keep their names."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    colour_grid: tuple[str, ...] = ("Cd",)
    """Names under which the colour is written: Cd, and `color` for Blender's default shader."""
    preview: Path | None = None
    """Film of the painting: mp4, gif or webp."""
    gamma: float | None = None
    """Extinction of density 1 in the preview, per cell: brightness without training again."""
    density_scale: float | None = None
    """Density that counts as 1; that of the training frame unless given."""
    backend: str = "auto"
    """What computes the automaton: auto, native or reference."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[StylizeConfig, tyro.conf.arg(name="")] = field(default_factory=StylizeConfig)
    """How the rule is applied."""
    film: FilmConfig = field(default_factory=FilmConfig)
    """How the preview is filmed."""

    def __post_init__(self) -> None:
        for name in ("gamma", "density_scale"):
            value = getattr(self, name)
            if value is not None and value <= 0:
                raise OptionError(f"--{name.replace('_', '-')} {value}: must be positive")
        if not self.colour_grid:
            raise OptionError("--colour-grid: at least one name is needed")


def run(arguments: Sequence[str]) -> None:
    """Read the options and paint."""
    paint(parse("stylize", Stylize, arguments))


def paint(options: Stylize) -> None:
    """Paint as asked, streaming: memory does not grow with the length of the sequence.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    model = Model.load(options.model)
    frames = find_frames(options.sequence, options.frames)
    for path in frames.paths:
        if path.resolve().parent == options.out.resolve():
            raise OptionError(f"--out {options.out}: is the folder of the input; choose another")
    if frames.gaps:
        say(f"{options.sequence}: frames missing: {', '.join(map(str, frames.gaps))}")
    scales = model.rule.scales
    scales = dataclasses.replace(
        scales,
        density=options.density_scale or scales.density,
        gamma=options.gamma or scales.gamma,
    )
    rule = dataclasses.replace(model.rule, scales=scales)
    box = sequence_box(frames, options.smoke)
    loads = [
        partial(read_smoke, path, options.smoke, frame=number)
        for number, path in zip(frames.numbers, frames.paths, strict=True)
    ]
    step = stepper(rule, options.backend)
    paintings = stylize(read_ahead(loads), rule, step, options.config, box=box)
    with ExitStack() as stack:
        film = None
        if options.preview is not None:
            film = stack.enter_context(Film(options.preview, options.film, box, scales))
        for painting, path in zip(
            tracked(paintings, "painting", len(loads), "frames"), frames.paths, strict=True
        ):
            write(painting, path, options)
            if film is not None:
                film.add(painting)
    say(f"painted: {options.out}" + (f", film: {options.preview}" if options.preview else ""))
