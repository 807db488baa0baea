"""Painting a sequence of smoke with a trained rule: from files to files, or in memory."""

import dataclasses
import json
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from typing import NamedTuple

import vnca
from vnca.core.errors import BackendUnavailableError, OptionError, SequenceError, Terminated
from vnca.core.files import remove_leftovers, writable_file, writable_folder
from vnca.core.memory import free_memory, memory_budget
from vnca.core.records import changed_fields
from vnca.core.volume import refined_transform
from vnca.engine import Compute, choose, compute_of
from vnca.io import SmokeFormat, read_smoke, with_fitted_scale
from vnca.io.film import SUFFIXES as FILMS
from vnca.io.painted import read_colour
from vnca.io.parts import smoke_cells
from vnca.io.provenance import as_told, read_provenance
from vnca.io.sequence import FrameSequence
from vnca.io.smoke_format import NO_VELOCITY, up_axis_of
from vnca.painting import Roll, StylizeConfig
from vnca.painting.chunk import Chunk, Chunking
from vnca.painting.painter import OnError, Painter
from vnca.painting.tiles import EDGES, Tiling, bytes_needed, likely_edge, shared_edge
from vnca.painting.tiles.deal import shared
from vnca.painting.tiles.painter import TiledPainter
from vnca.ranks import Alone, Ranks
from vnca.recipe import Watch, recorded, tracked
from vnca.recipe.directing import digest, directed, say_styles
from vnca.recipe.film import Film, FilmConfig, Shown
from vnca.recipe.sequence import (
    open_sequence,
    placed,
    region_bounds,
    require_dense_enough,
    sequence_region,
)
from vnca.rule import density_scale, gamma_for_cell_opacity
from vnca.rule.model import MODEL_NAME, Model
from vnca.rule.paint import require_refinement


@dataclass(frozen=True, kw_only=True)
class StylizeRun:
    """A painting of a sequence in files."""

    model: Path
    """A model file, or the folder of a training run."""
    sequence: str
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    out: Path
    """Folder for the painted frames, which keep their names."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    colour_grid: tuple[str, ...] = ("Cd",)
    """Names under which the colour is written: Cd, `color` as Blender names it, or several."""
    preview: Path | None = None
    """Film of the painting: mp4, gif or webp."""
    refine: int = 1
    """Paint on a grid so many times as fine as that of the smoke, at most 8."""
    gamma: float | None = None
    """Extinction of density 1, per cell of the smoke, with which the painting is to be seen:
    brightness without training again. The files record it."""
    density_scale: float | None = None
    """Density that counts as 1; that of the training frame unless given."""
    backend: str = "auto"
    """What computes the automaton."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    precision: str = "float32"
    """What the native kernel rounds the factors of its products to; bfloat16 is quicker where the
    processor has it."""
    memory_budget: str = "auto"
    """Memory to paint with, such as 4GB: frames that take more are painted by tiles. Of itself that
    happens where they would take more than half of what is free."""
    tile: int | None = None
    """Paint by tiles of so many cells of the automaton a side, a multiple of 8; the files are the
    same."""
    halo: int | None = None
    """Cells around a tile that it is given at a time, and steps it does with them; the cheapest
    unless given."""
    resume: bool = False
    """Go on with a painting that was ended before its last frame, to the very same files."""
    overwrite: bool = False
    """Replace painted frames that the folder holds; with `resume`, where those are of another
    painting."""
    on_error: OnError = "stop"
    """With a frame that cannot be read: stop, skip it, or hold the smoke of the one before."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: StylizeConfig = field(default_factory=StylizeConfig)
    """How the rule is applied."""
    film: FilmConfig = field(default_factory=FilmConfig)
    """How the preview is filmed."""
    chunking: Chunking = field(default_factory=Chunking)
    """Which of the frames are painted, apart from the others."""

    def __post_init__(self) -> None:
        Compute(self.backend, precision=self.precision)
        require_refinement(self.refine)
        memory_budget(self.memory_budget)
        Tiling(EDGES[0] if self.tile is None else self.tile, self.halo)
        for name in ("gamma", "density_scale"):
            value = getattr(self, name)
            if value is not None and not 0 < value < inf:
                raise OptionError(f"`{name}` {value}: must be positive")
        if self.preview is not None and self.preview.suffix.lower() not in FILMS:
            raise OptionError(f"`preview` {self.preview}: expected a film ({', '.join(FILMS)})")
        if self.preview is None and (idle := changed_fields(self.film, FilmConfig())):
            raise OptionError(f"`film.{idle[0]}`: shapes a film; name one with `preview`")
        if not self.colour_grid:
            raise OptionError("`colour_grid`: at least one name is needed")
        names = (self.smoke.density_grid, *self.colour_grid)
        if len(set(names)) < len(names):
            raise OptionError(
                f"`colour_grid` {' '.join(self.colour_grid)}: each needs a name of its own, not "
                f"that of another or of the density ({self.smoke.density_grid})"
            )


class Scales(NamedTuple):
    """What smoke is painted with, where it is not as the rule was trained."""

    density: float | None = None
    gamma: float | None = None

    @classmethod
    def fitted(cls, frame: Path, smoke: SmokeFormat, opacity: float) -> "Scales":
        """For smoke that a rule never saw: as training on one of its frames would choose them.

        `opacity` is that of a cell of typical smoke.
        """
        seen = dataclasses.replace(smoke, velocity_grid=NO_VELOCITY)
        density = read_smoke(frame, seen).density_field.values
        scale = density_scale(density)
        return cls(scale, gamma_for_cell_opacity(density / scale, opacity))


_TOLD = ("strength", "density_strength", "steps_per_frame", "domain")
"""What painted files tell one by one."""


def run(
    options: StylizeRun, watch: Watch, model: Model | None = None, ranks: Ranks | None = None
) -> Iterator[Path | None]:
    """Make ready to paint as asked; memory does not grow with the length of the sequence.

    Args:
        options: What to paint, and how.
        watch: Is told how far it has come. What it raises ends the painting once a frame is
            finished.
        model: The model of the options, if it is loaded already.
        ranks: Who shares the tiles of each frame; all call this, with the same options.

    Returns:
        What paints: the file of each frame as it is finished, None for one that is left out.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    count = _Count(watch)
    painter = _painter(options, watch, model, count, ranks or Alone())
    return _paint(painter, options, watch, count)


def film_painted(options: StylizeRun, watch: Watch, model: Model | None = None) -> None:
    """Make the film of a painting whose frames are all there, the same as its preview.

    Args:
        options: What was painted, and how.
        watch: Is told how far it has come.
        model: The model of the options, if it is loaded already.

    Raises:
        SequenceError: If a frame is not there yet.
        VncaError: If an input cannot be used, or the film cannot be written.
    """
    painter = _painter(options, watch, model, _Count(watch), Alone())
    for target in map(painter.target, painter.frames):
        if not target.exists() or read_provenance(target) is None:
            raise SequenceError(f"{target}: is not painted yet; a film shows all of its frames")
    with ExitStack() as stack:
        film = _film(options, painter, stack, watch)
        if film is None or options.preview is None:
            return
        for frame in tracked(painter.frames, watch, "filming", len(painter.frames), "frames"):
            film.add(read_painted(painter.target(frame), frame.path, options))
    watch.made("film", options.preview)


def _painter(
    options: StylizeRun, watch: Watch, model: Model | None, count: "_Count", ranks: Ranks
) -> Painter:
    """What paints as asked, after a look at all that it takes."""
    model = model or Model.load(options.model)
    rule = model.rule.rescaled(density=options.density_scale, gamma=options.gamma)
    sequence = open_sequence(options.sequence, options.frames, watch)
    chunk = Chunk.of(sequence, options.chunking)
    writable_folder(options.out)
    if chunk.state_out is not None:
        writable_file(chunk.state_out)
    if options.preview and ranks.leads:
        writable_file(options.preview)
        remove_leftovers(options.preview.parent, [options.preview.name])
    if any(f.path.resolve().parent == options.out.resolve() for f in sequence):
        raise OptionError(f"`out` {options.out}: is the folder of the input; choose another")
    smoke = with_fitted_scale(options.smoke, sequence)
    region = sequence_region(sequence, smoke, watch, without_broken=options.on_error != "stop")
    require_dense_enough(sequence, smoke, rule.scales.density)
    rule = placed(rule, region, watch)
    compute = shared(compute_of(options.backend, options.device, options.precision), ranks)
    backend = choose(compute, steered=options.config.steers).name
    ready = directed(
        Roll(rule, options.config, region.box, compute), model, options.refine, sequence, smoke
    )
    say_styles(model, options.config, watch)
    roll = ready.roll
    facts = _facts(options, model, roll)
    tiling = _tiling(options, roll, sequence, watch, ranks)
    make = Painter if tiling is None else partial(TiledPainter, tiling=tiling, watch=count.note)
    return make(
        sequence,
        options.out,
        roll,
        region.lattice,
        smoke,
        options.colour_grid,
        options.on_error,
        conditions={
            "the version of vnca": vnca.__version__,
            "`refine`": options.refine,
            "the model": digest(rule),
            "the list of frames": [frame.path.name for frame in sequence],
            "the place of its cells in the world": region.lattice.to_world.tolist(),
            "the box of the smoke": region.box,
            "`backend`": backend,
            **({} if compute.device == "cpu" else {"`device`": compute.device_type}),
            "`precision`": options.precision,
            "`density_scale`": rule.scales.density,
            "`gamma`": rule.scales.gamma,
            "the name of the model": facts["model"],
            "`colour_grid`": options.colour_grid,
            **{
                f"`{name}`": value
                for values in (options.config, smoke)
                for name, value in recorded(values).items()
            },
            "`steps_per_frame`": roll.steps_per_frame,
            "`domain`": roll.domain_kind,
            **ready.conditions,
            **chunk.conditions(sequence),
        },
        tell=watch.note,
        refine=options.refine,
        facts=facts,
        chunk=chunk,
        ranks=ranks,
    )


@dataclass
class _Count:
    """Tells how many frames are painted, and what is being done with the next."""

    watch: Watch
    total: int = 0
    done: int = 0

    def note(self, line: str) -> None:
        # SIGTERM waits for the frame; who cancels does not.
        with suppress(Terminated):
            self.watch.progress("painting", self.done, self.total, "frames", line)


def _tiling(
    options: StylizeRun, roll: Roll, sequence: FrameSequence, watch: Watch, ranks: Ranks
) -> Tiling | None:
    """How frames are cut; None where they are painted as wholes."""
    if ranks.size > 1 and options.on_error != "stop":
        raise OptionError(f"`on_error` {options.on_error}: not with several ranks of MPI")
    if options.config.steers:
        if options.tile is not None or options.halo is not None or ranks.size > 1:
            raise OptionError(
                "`tile`: with `guide` or `pattern_size` frames are painted as wholes; leave it "
                f"out{' and paint without mpirun' if ranks.size > 1 else ''}"
            )
        return None
    if options.tile is not None:
        return Tiling(options.tile, options.halo)
    given = memory_budget(options.memory_budget)
    budget = given or free_memory() / 2 / ranks.beside
    cells = max(smoke_cells(frame.path, options.smoke) for frame in sequence)
    sizes = {"grid": roll.grid, "finer": roll.finer}
    if ranks.size > 1:
        return Tiling(shared_edge(budget, cells, ranks.size, **sizes), options.halo)
    needed = bytes_needed(cells, **sizes)
    if needed <= budget:
        if options.halo is not None:
            raise OptionError("`halo`: frames are painted as wholes here; give `tile`, too")
        return None
    tiling = Tiling(likely_edge(budget, **sizes), options.halo)
    watch.note(
        f"frames of {cells} cells would take about {needed / 1e9:.1f} GB; painting tiles of "
        f"{tiling.edge} cells a side, to the same files"
    )
    return tiling


def _paint(
    painter: Painter, options: StylizeRun, watch: Watch, count: _Count
) -> Iterator[Path | None]:
    """The files of the frames, painted to the end, or until `watch` or the caller ends it."""
    total, first = len(painter.frames), painter.chunk.first
    count.total = total
    with ExitStack() as stack:
        film = _film(options, painter, stack, watch) if painter.ranks.leads else None
        unfinished = painter.begin(resume=options.resume, overwrite=options.overwrite)
        already = max(0, len(unfinished.sources) - first)
        try:
            with closing(painter.paint(unfinished)) as paths:
                watch.progress("painting", already, total, "frames")
                for finished, (frame, path) in enumerate(
                    zip(painter.frames, paths, strict=True), 1
                ):
                    if film is not None and path is not None:
                        film.add(read_painted(path, frame.path, options))
                    yield path
                    count.done = finished
                    if finished > already:
                        watch.progress("painting", finished, total, "frames")
        except KeyboardInterrupt:
            watch.note(f"stopped after {painter.finished} of {total} frames; `resume` goes on")
            raise
    painter.discard()
    if painter.chunk.state_out is not None:
        watch.made("state", painter.chunk.state_out)
    watch.made("painted", options.out)
    if film is not None and options.preview is not None:
        watch.made("film", options.preview)


def _film(options: StylizeRun, painter: Painter, stack: ExitStack, watch: Watch) -> Film | None:
    """The film of a preview, if one is wanted and what it takes is installed."""
    if options.preview is None:
        return None
    cells = refined_transform(painter.lattice.to_world, painter.roll.grid)
    bounds = region_bounds(painter.roll.box, cells)
    try:
        device = painter.roll.compute.device
        film = Film(
            options.preview, options.film, bounds, frames=len(painter.frames), device=device
        )
        return stack.enter_context(film)
    except BackendUnavailableError as error:
        later = f"vnca render {options.out} `out` {options.preview}"
        watch.note(f"{error}; painting without a preview, which {later} makes later")
        return None


def read_painted(path: Path, source: Path, options: StylizeRun) -> Shown:
    """A painted frame as its file has it: the film is the same with `resume`, and by `render`."""
    up = up_axis_of(source, options.smoke)
    told = read_provenance(path)
    assert told is not None, "it was written a moment ago"
    # A factor that was fitted is told as the number it came to.
    format = as_told(SmokeFormat(options.smoke.density_grid, up_axis=up), told)
    smoke = read_smoke(path, options.film.reading(format))
    colour = read_colour(path, format, grid=options.colour_grid[0], box=smoke.box)
    assert colour is not None, "it was written a moment ago"
    return Shown(smoke, colour, told.extinction)


def _facts(options: StylizeRun, model: Model, roll: Roll) -> dict[str, str | int | float]:
    """What painted files tell of the rule and the options, beside what they are painted from."""
    path = options.model.resolve()
    name = path.parent.name if path.name == MODEL_NAME else path.stem
    config = options.config
    asked = changed_fields(config, StylizeConfig(warmup=config.warmup, seed=config.seed))
    further = {n: recorded(config)[n] for n in asked if n not in _TOLD}
    return {
        **({"direction": json.dumps(further)} if further else {}),
        "version": vnca.__version__,
        "model": name,
        "style": str(model.training.get("style", "")),
        "refine": options.refine,
        "strength": config.strength,
        "density_strength": config.density_strength,
        "steps_per_frame": roll.steps_per_frame,
        "warmup": config.warmup,
        "domain": roll.domain_kind,
        "seed": config.seed,
    }
