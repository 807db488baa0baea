"""`vnca texture film`: flat textures as films, and as pictures that fit edge to edge."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from vnca.cli.options import parse
from vnca.cli.terminal import Progress, made
from vnca.cli.textures import GrowthConfig, texture_model
from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.core.files import writable_file, writable_folder
from vnca.core.records import changed_fields
from vnca.engine import compute_of
from vnca.io.film import SUFFIXES as FILMS
from vnca.io.film import FilmWriter
from vnca.io.picture import SUFFIXES as PICTURES
from vnca.io.picture import write_image
from vnca.painting.flat import FIELDS, MotionField, flat_domain, grow_flat, picture
from vnca.rule.model import Model


@dataclass(frozen=True)
class FlatFilm:
    """How a flat texture is filmed."""

    frames: int = 96
    """Pictures in the film, or in the folder."""
    fps: float = 24.0
    """Pictures a second."""
    pixels_per_cell: int = 4
    """Along each side of a cell."""

    def __post_init__(self) -> None:
        for name, most in (("frames", 10**6), ("pixels_per_cell", 64)):
            if not 1 <= getattr(self, name) <= most:
                raise OptionError(
                    f"`film.{name}` {getattr(self, name)}: must be from 1 to {most:,}"
                )


@dataclass(frozen=True)
class FilmFlat:
    """Film a flat texture, or write its pictures: opposite edges fit together."""

    model: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MODEL")]
    """A model file, or the folder of a training run (vnca texture train --dimensions 2)."""
    out: Path
    """A film (mp4, gif, webp); a picture (png, jpg, exr) of its beginning; or a folder, for
    0001.png and on. A .webp is a film."""
    size: Annotated[tuple[int, int], tyro.conf.arg(metavar="COLUMNS ROWS")] = (64, 64)
    """Columns and rows, cells: any, whatever the rule was trained on."""
    motion_field: str | None = None
    """How the pattern moves: circular, hyperbolic, … by name, a file of vectors (.npy, .flo, .exr),
    or a film; as in training unless given."""
    motion_speed: float | None = None
    """Cells a frame where it is fastest; as in training unless given."""
    film: FlatFilm = field(default_factory=FlatFilm)
    """How it is filmed."""
    grow: GrowthConfig = field(default_factory=GrowthConfig)
    """How it is grown."""

    def __post_init__(self) -> None:
        flat_domain(*self.size)
        suffix = self.out.suffix.lower()
        if suffix and suffix not in (*FILMS, *PICTURES):
            raise OptionError(
                f"--out {self.out}: expected a film ({', '.join(FILMS)}), a picture "
                f"({', '.join(PICTURES)}), or a folder"
            )
        given = [
            name for name in changed_fields(self.film, FlatFilm()) if name in ("frames", "fps")
        ]
        if given and suffix not in ("", *FILMS):
            raise OptionError(f"`film.{given[0]}`: a picture has none; --out {self.out}")
        if self.motion_speed is not None and not 0 < self.motion_speed < float("inf"):
            raise OptionError(f"--motion-speed {self.motion_speed}: must be positive")


def run(arguments: Sequence[str]) -> None:
    """Read the options and film.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    options = parse("texture film", FilmFlat, arguments)
    suffix = options.out.suffix.lower()
    if suffix:
        writable_file(options.out)
    else:
        writable_folder(options.out)
    model = texture_model(options.model, options.grow.style)
    if model.training.get("dimensions") != 2:
        raise OptionError(
            f"{options.model}: is not a flat texture (vnca texture train --dimensions 2)"
        )
    velocity = _velocity(options, model)
    if suffix in FILMS:
        with FilmWriter(options.out, options.film.fps) as film:
            for shown in _pictures(options, model, velocity, options.film.frames):
                film.add(shown)
    elif suffix:
        write_image(options.out, *_pictures(options, model, velocity, 1))
    else:
        options.out.mkdir(parents=True, exist_ok=True)
        shown = _pictures(options, model, velocity, options.film.frames)
        for number, each in enumerate(shown, 1):
            write_image(options.out / f"{number:04d}.png", each)
    made("film", options.out)


def _velocity(options: FilmFlat, model: Model) -> FloatArray | None:
    """What the pattern moves by, cells a frame; none if the rule was never told to move."""
    given, told = options.motion_field, model.training.get("motion_field")
    if not model.rule.config.velocity_prior:
        if given is not None or options.motion_speed is not None:
            raise OptionError(
                f"{options.model}: was not trained to move; train it with a `motion_field`"
            )
        return None
    if given is None and told not in FIELDS:
        raise OptionError(
            f"{options.model}: was trained to move as {told} says; give that, or another "
            f"`motion_field`: {', '.join(FIELDS)}"
        )
    if given is None or given in FIELDS:
        asked = MotionField.named(given or str(told))
    else:
        from vnca.training.motion_field import motion_field  # which needs torch, for films

        asked = motion_field(given)
    speed = options.motion_speed or model.rule.scales.velocity
    return asked.velocity(*options.size, speed)


def _pictures(
    options: FilmFlat, model: Model, velocity: FloatArray | None, count: int
) -> Iterator[FloatArray]:
    """The first picture, and those of its later life; linear RGB `[r, c, 3]`."""
    grow, pause = options.grow, options.grow.steps_per_frame
    if pause is None:
        pause = model.rule.config.steps_per_frame
    columns, rows = options.size
    total = grow.steps + (count - 1) * pause
    with Progress(f"growing {columns} × {rows} cells,", total, "steps") as progress:
        steps = itertools.count(1)
        layers = grow_flat(
            model.rule,
            columns,
            rows,
            steps=grow.steps,
            seed=grow.seed,
            pause=pause,
            velocity=velocity,
            compute=compute_of(grow.backend, grow.device),
            watch=lambda: progress.show(next(steps)),
        )
        for layer in itertools.islice(layers, count):
            yield picture(layer, options.film.pixels_per_cell)
