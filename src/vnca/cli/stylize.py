"""`vnca stylize MODEL SEQUENCE --out DIR`."""

import dataclasses
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from vnca.automaton.model import Model
from vnca.automaton.stepper import stepper
from vnca.cli.film import Film, FilmConfig
from vnca.cli.options import parse, say
from vnca.cli.progress import tracked
from vnca.cli.sequence import open_sequence, sequence_box, volumes
from vnca.errors import ModelError, OptionError
from vnca.files import writable_file, writable_folder
from vnca.io.smoke import SmokeFormat, with_fitted_scale, write_painted
from vnca.io.video import SUFFIXES as FILMS
from vnca.stylize.config import StylizeConfig
from vnca.stylize.roll import stylize


@dataclass(frozen=True)
class Stylize:
    """Paint a smoke sequence with a trained rule."""

    model: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MODEL")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEQUENCE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    out: Path
    """Folder for the painted frames, which keep their names."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    colour_grid: tuple[str, ...] = ("Cd",)
    """Names under which the colour is written: Cd, `color` as Blender names it, or several."""
    preview: Path | None = None
    """Film of the painting: mp4, gif or webp."""
    gamma: float | None = None
    """Extinction of density 1 in the preview, per cell: brightness without training again."""
    density_scale: float | None = None
    """Density that counts as 1; that of the training frame unless given."""
    backend: Literal["auto", "native", "reference"] = "auto"
    """What computes the automaton."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[StylizeConfig, tyro.conf.arg(name="")] = field(default_factory=StylizeConfig)
    """How the rule is applied."""
    film: FilmConfig = field(default_factory=FilmConfig)
    """How the preview is filmed."""

    def __post_init__(self) -> None:
        for name in ("gamma", "density_scale"):
            value = getattr(self, name)
            if value is not None and not 0 < value < inf:
                raise OptionError(f"--{name.replace('_', '-')} {value}: must be positive")
        if self.preview is not None and self.preview.suffix.lower() not in FILMS:
            raise OptionError(f"--preview {self.preview}: expected a film ({', '.join(FILMS)})")
        if not self.colour_grid:
            raise OptionError("--colour-grid: at least one name is needed")
        names = (self.smoke.density_grid, *self.colour_grid)
        if len(set(names)) < len(names):
            raise OptionError(
                f"--colour-grid {' '.join(self.colour_grid)}: each needs a name of its own, not "
                f"that of another or of the density ({self.smoke.density_grid})"
            )


def run(arguments: Sequence[str]) -> None:
    """Read the options and paint; smoke is read as it was for training unless told otherwise."""
    options = parse("stylize", Stylize, arguments)
    recorded = Model.load(options.model).training.get("smoke")
    if recorded:
        missing: Any = tyro.MISSING
        defaults = Stylize(missing, missing, missing, smoke=_recorded(options.model, recorded))
        options = parse("stylize", Stylize, arguments, default=defaults)
    paint(options)


def _recorded(model: Path, smoke: Any) -> SmokeFormat:
    try:
        return SmokeFormat(**smoke)
    except TypeError as error:
        raise ModelError(f"{model}: damaged model metadata (smoke: {error})") from error


def paint(options: Stylize) -> None:
    """Paint as asked, streaming: memory does not grow with the length of the sequence.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    model = Model.load(options.model)
    scales = model.rule.scales
    scales = dataclasses.replace(
        scales,
        density=options.density_scale or scales.density,
        gamma=options.gamma or scales.gamma,
    )
    rule = dataclasses.replace(model.rule, scales=scales)
    sequence = open_sequence(options.sequence, options.frames)
    writable_folder(options.out)
    if options.preview:
        writable_file(options.preview)
    if any(f.path.resolve().parent == options.out.resolve() for f in sequence):
        raise OptionError(f"--out {options.out}: is the folder of the input; choose another")
    smoke = with_fitted_scale(options.smoke, sequence)
    box = sequence_box(sequence, smoke)
    paintings = stylize(
        volumes(sequence, smoke),
        rule,
        stepper(rule, options.backend),
        options.config,
        box=box,
    )
    with ExitStack() as stack:
        film = None
        if options.preview is not None:
            film = stack.enter_context(
                Film(options.preview, options.film, box, frames=len(sequence))
            )
        for painting, frame in zip(
            tracked(paintings, "painting", len(sequence), "frames"), sequence, strict=True
        ):
            write_painted(
                options.out / f"{frame.path.stem}.vdb",
                frame.path,
                options.smoke,
                density=painting.density,
                colour=painting.colour,
                box=painting.smoke.box,
                colour_grids=options.colour_grid,
            )
            if film is not None:
                gamma = scales.gamma / scales.density
                film.add(painting.density, painting.colour, painting.smoke.origin, gamma=gamma)
    say(f"painted: {options.out}")
    if options.preview:
        say(f"film: {options.preview}")
