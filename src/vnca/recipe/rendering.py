"""Films and pictures of a sequence, painted or not."""

import dataclasses
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core import FloatArray
from vnca.core.errors import OptionError, SequenceError
from vnca.core.files import existing_file, writable_file
from vnca.core.records import changed, changed_fields, with_values
from vnca.engine import device_named
from vnca.io import SmokeFormat, with_fitted_scale
from vnca.io.film import SUFFIXES as FILMS
from vnca.io.film import contact_sheet
from vnca.io.painted import read_colour
from vnca.io.picture import SUFFIXES as PICTURES
from vnca.io.picture import write_image
from vnca.io.provenance import as_told, read_provenance, velocity_of
from vnca.io.sequence import FrameSequence
from vnca.recipe import SILENT, Watch, tracked
from vnca.recipe.film import Bounds, Film, FilmConfig, Shown, behind, picture
from vnca.recipe.sequence import open_sequence, region_bounds, sequence_bounds, volumes
from vnca.recipe.stylizing import PaintedFrame
from vnca.rule import gamma_for_cell_opacity

TRANSPARENT = (".png", ".exr")
"""Pictures that can go without a background."""
CELL_OPACITY = {"painted": 0.95, "unpainted": 0.15}
"""Opacity of a cell of typical smoke that γ is chosen for where none is given or told."""


@dataclass(frozen=True, kw_only=True)
class RenderRun:
    """A film or a turntable of a sequence, painted or not, or a picture of each frame."""

    sequence: str
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    out: Path
    """A film (mp4, gif, webp), or a picture (png, exr); with #### in its name, one a frame."""
    frames: str | None = None
    """Frames to show, such as 30-53 or 1,4,7-9; all unless given."""
    colour_grid: str = "Cd"
    """Grid of linear colours; smoke without it is white."""
    gamma: float | None = None
    """Extinction of density 1, per cell: of what the rule took for 1, per cell of the smoke, as in
    `vnca stylize`, where a file tells of its painting. Unless given, painted frames are as opaque
    as they were painted for; for others it is chosen from the first."""
    turntable: int = 0
    """Hold each frame for so many pictures while the camera goes once around the smoke."""
    strip: int = 0
    """Put so many frames, evenly spaced, side by side into one picture."""
    transparent: bool = False
    """Leave the background out of pictures (png, exr)."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files. Painted ones tell which axis points up and how their velocity
    is read, unless that is given."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    film: FilmConfig = field(default_factory=FilmConfig)
    """The camera."""

    def __post_init__(self) -> None:
        if not (self.is_film or self.out.suffix.lower() in PICTURES):
            raise OptionError(
                f"`out` {self.out}: expected a film ({', '.join(FILMS)}) or a picture "
                f"({', '.join(PICTURES)})"
            )
        if self.gamma is not None and not 0 < self.gamma < inf:
            raise OptionError(f"`gamma` {self.gamma}: must be positive")
        if self.turntable < 0:
            raise OptionError(f"`turntable` {self.turntable}: must not be negative")
        if self.transparent and self.out.suffix.lower() not in TRANSPARENT:
            raise OptionError(
                f"`transparent`: {self.out} has no transparency; write {' or '.join(TRANSPARENT)}"
            )
        if self.strip < 0 or (self.strip and self.is_film):
            raise OptionError(f"`strip` {self.strip}: a number of frames, with a picture as `out`")
        if self.turntable and not self.is_film:
            raise OptionError("`turntable`: needs a film (mp4, gif, webp) as `out`")
        self._refuse_idle_options()

    def _refuse_idle_options(self) -> None:
        """Refuse what would change nothing.

        Raises:
            OptionError: If there is such an option.
        """
        given = changed_fields(self.film, FilmConfig())
        if self.turntable and "turn" in given:
            raise OptionError("`film.turn`, `turntable`: one of them, not both")
        for name in ("turn", "fps"):
            if name in given and not self.is_film:
                raise OptionError(f"`film.{name}`: a picture has none; `out` {self.out}")
        if self.transparent and "background" in given:
            raise OptionError("`film.background`, `transparent`: one of them, not both")
        if self.smoke.fields:
            raise OptionError("`fields`: pictures show none")
        if not self.film.shutter and (idle := velocity_of(self.smoke)):
            raise OptionError(f"`{next(iter(idle))}`: changes nothing where `film.shutter` is 0")

    @property
    def is_film(self) -> bool:
        """Whether the output is a film rather than pictures."""
        return self.out.suffix.lower() in FILMS


def render(
    sequence: str | Path | PaintedFrame | Iterable[PaintedFrame],
    out: str | Path,
    *,
    frames: str | None = None,
    colour_grid: str = "Cd",
    gamma: float | None = None,
    turntable: int = 0,
    strip: int = 0,
    transparent: bool = False,
    film: FilmConfig | Mapping[str, Any] | None = None,
    device: str = "auto",
    watch: Watch = SILENT,
    **options: Any,
) -> Path:
    """Make a film, or pictures, of a sequence, painted or not, as `vnca render` does.

    Args:
        sequence: A folder, a pattern (`smoke_####.vdb`) or a file; or frames that `stylize` gave.
        out: A film (mp4, gif, webp), or a picture (png, exr); with #### in its name, one a frame.
        frames: Which frames of a sequence in files, such as `30-53`; all unless given.
        colour_grid: The grid of linear colours in files; smoke without it is white.
        gamma: Extinction of density 1, per cell; unless given, as the painting was made for.
        turntable: Hold each frame for so many pictures while the camera goes around the smoke.
        strip: Put so many frames, evenly spaced, side by side into one picture.
        transparent: Leave the background out of pictures.
        film: The camera: a `FilmConfig`, or some of its fields, as `{"rows": 512}`.
        device: Where to compute: `auto`, `cpu`, `cuda`, or such as `cuda:1`.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `SmokeFormat`; painted files tell which axis points up and how their
            velocity is read, unless that is given.

    Returns:
        `out`.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    asked = RenderRun(
        sequence=str(sequence) if isinstance(sequence, (str, Path)) else "",
        out=Path(out),
        frames=frames,
        colour_grid=colour_grid,
        gamma=gamma,
        turntable=turntable,
        strip=strip,
        transparent=transparent,
        smoke=with_values(SmokeFormat(), options),
        device=device,
        film=changed("film", FilmConfig(), film),
    )
    if isinstance(sequence, (str, Path)):
        run(asked, watch)
    else:
        given = [sequence] if isinstance(sequence, PaintedFrame) else [*sequence]
        _render_frames(given, asked, watch)
    return asked.out


def _render_frames(given: Sequence[PaintedFrame], options: RenderRun, watch: Watch) -> None:
    """Render frames in memory."""
    of_files = ("strip", "gamma", "frames", "colour_grid")
    plain = {name: getattr(RenderRun, name) for name in of_files}
    plain = dataclasses.replace(options, **plain)
    idle = changed_fields(options.smoke, SmokeFormat()) + changed_fields(options, plain)
    if idle:
        raise OptionError(f"`{idle[0]}`: needs a sequence in files")
    _require_enough_names(len(given), options)
    writable_file(options.out)
    seen = [frame.volume for frame in given if not frame.volume.box.is_empty]
    if not seen:
        raise SequenceError("`sequence`: there is no smoke in any frame")
    lower, upper = zip(*(region_bounds(v.box, v.index_to_world) for v in seen), strict=True)
    bounds = np.min(lower, axis=0), np.max(upper, axis=0)
    shown = (frame.shown for frame in given)
    _write(tracked(shown, watch, "rendering", len(given), "frames"), len(given), bounds, options)


def run(options: RenderRun, watch: Watch) -> None:
    """Render as asked.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    sequence = open_sequence(options.sequence, options.frames, watch)
    writable_file(options.out)
    if options.strip:
        write_image(options.out, contact_sheet([strip(sequence, options, options.strip)]))
        watch.made("rendered", options.out)
        return
    _require_enough_names(len(sequence), options)
    format = _as_painted(options, sequence)
    bounds = sequence_bounds(sequence, format)
    shown = tracked(_frames(sequence, options, format), watch, "rendering", len(sequence), "frames")
    _write(shown, len(sequence), bounds, options)
    watch.made("rendered", options.out)


def _require_enough_names(count: int, options: RenderRun) -> None:
    if not options.is_film and count > 1 and "#" not in options.out.name:
        raise OptionError(
            f"`out` {options.out}: {count} frames need a film (mp4, gif, webp), "
            "a name such as frame_####.png, or `frames`"
        )


def _write(shown: Iterator[Shown], count: int, bounds: Bounds, options: RenderRun) -> None:
    if options.is_film:
        _film(shown, count, bounds, options)
    else:
        _pictures(shown, bounds, options)


def strip(sequence: FrameSequence, options: RenderRun, count: int) -> list[FloatArray]:
    """Pictures, linear RGB `[rows, columns, 3]`, of `count` frames evenly spaced in a sequence."""
    picked = sorted({round(at) for at in np.linspace(0, len(sequence) - 1, count)})
    some = FrameSequence(tuple(sequence[at] for at in picked))
    format = _as_painted(options, sequence)
    bounds = sequence_bounds(sequence, format)
    return [_picture(frame, bounds, options) for frame in _frames(some, options, format)]


def _as_painted(options: RenderRun, sequence: FrameSequence) -> SmokeFormat:
    """How smoke is read: as painted files tell, but for what is given."""
    told = read_provenance(existing_file(sequence[0].path))
    format = options.film.reading(as_told(options.smoke, told) if told else options.smoke)
    return with_fitted_scale(format, sequence)


def _frames(sequence: FrameSequence, options: RenderRun, seen: SmokeFormat) -> Iterator[Shown]:
    chosen: float | None = None  # one for all frames that do not tell, or brightness flickers
    for frame, smoke in zip(sequence, volumes(sequence, seen), strict=True):
        colour = read_colour(frame.path, seen, grid=options.colour_grid, box=smoke.box)
        told = read_provenance(frame.path)
        if told is None and chosen is None and smoke.density.any():
            opacity = CELL_OPACITY["unpainted" if colour is None else "painted"]
            gamma = options.gamma or gamma_for_cell_opacity(smoke.density, opacity)
            chosen = gamma / smoke.cell_length
        if colour is None:
            colour = np.ones((*smoke.density.shape, 3), dtype=np.float32)
        extinction = told.seen_with(options.gamma) if told else chosen or 1.0
        yield Shown(smoke, colour, extinction)


def _film(shown: Iterator[Shown], frames: int, bounds: Bounds, options: RenderRun) -> None:
    repeats = options.turntable or 1
    config = dataclasses.replace(options.film, turn=360.0) if options.turntable else options.film
    place = device_named(options.device)
    with Film(options.out, config, bounds, frames=frames * repeats, device=place) as film:
        for frame in shown:
            for _ in range(repeats):
                film.add(frame, still=repeats > 1)


def _pictures(shown: Iterator[Shown], bounds: Bounds, options: RenderRun) -> None:
    for frame in shown:
        write_image(_numbered(options.out, frame.smoke.frame), _picture(frame, bounds, options))


def _picture(frame: Shown, bounds: Bounds, options: RenderRun) -> FloatArray:
    device = device_named(options.device)
    view = picture(frame, options.film, bounds=bounds, turned=0.0, device=device)
    return view.rgba if options.transparent else view.over(behind(options.film))


def _numbered(path: Path, frame: int) -> Path:
    """The path with its #### replaced by a frame number of as many digits, and its minus."""
    sign = "-" if frame < 0 else ""
    number = abs(frame)
    return path.with_name(re.sub("#+", lambda run: f"{sign}{number:0{len(run[0])}d}", path.name))
