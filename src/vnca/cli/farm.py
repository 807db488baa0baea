"""`vnca farm`, `vnca sweep` and `vnca plan`: work for many machines, and what it takes."""

import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import parse, print_json
from vnca.cli.terminal import Terminal, clock, made
from vnca.core.errors import OptionError
from vnca.core.files import writable_file
from vnca.direction.shot import Shot
from vnca.farm.count import active_cells, around, counted
from vnca.farm.exchange import exchanged
from vnca.farm.formats import Format, write_job
from vnca.farm.plan import measured_costs, planned
from vnca.farm.shots import Chunks, shots_job
from vnca.io import SmokeFormat
from vnca.painting.tiles import bytes_needed
from vnca.recipe.sequence import open_sequence, sequence_region
from vnca.rule.library import load_style
from vnca.rule.model import Model
from vnca.rule.paint import require_refinement


@dataclass(frozen=True, kw_only=True)
class Farm:
    """Write a job that trains, paints in chunks and films shots, for a farm to run.

    The shots are files as `vnca paint shot.toml` takes them, or tables as `vnca sweep` does. The
    paths in the job are absolute: all machines have to see them. docs/guide/farm.md says how each
    farm takes a job.
    """

    format: Annotated[tyro.conf.Positional[Format], tyro.conf.arg(metavar="FORMAT")]
    """Of the job: openjd (Deadline Cloud), opencue, tractor, or commands, a shell script."""
    shots: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")]
    """Shot files, or one table of trainings."""
    out: Path
    """File of the job."""
    program: str = "vnca"
    """How vnca is called on the farm, such as /opt/vnca/bin/vnca."""
    env: tuple[str, ...] = ()
    """Variables that all tasks are given, such as OMP_NUM_THREADS=8."""
    retries: int = 2
    """How often a task that failed is tried again; it goes on where it was."""
    chunks: Chunks = field(default_factory=Chunks)
    """How shots are cut into chunks, and in what they vary."""

    def __post_init__(self) -> None:
        if self.retries < 0:
            raise OptionError(f"`retries` {self.retries}: must not be negative")
        for text in self.env:
            name, joint, _ = text.partition("=")
            if not joint or not name.isidentifier() or not name.isascii():
                raise OptionError(f"`env` {text}: expected NAME=VALUE")


def run(arguments: Sequence[str]) -> None:
    """Read the options and write the job."""
    options = parse("farm", Farm, arguments)
    writable_file(options.out)
    program = shlex.split(options.program)
    if not options.shots or not program:
        raise OptionError("vnca farm: names no file" if program else "`program`: names nothing")
    first, *others = options.shots
    if Shot.load(first).values.keys() >= {"pictures"}:
        if others or options.chunks != Chunks():
            raise OptionError(f"{first}: a table of trainings is a job of its own")
        from vnca.farm.sweep import sweep_job  # loads torch

        job = sweep_job(first, program)
    else:
        job = shots_job(options.shots, options.chunks, program)
    variables = dict(text.split("=", 1) for text in options.env)
    write_job(job.given(variables, options.retries), options.format, options.out)
    made("job", options.out)


@dataclass(frozen=True, kw_only=True)
class SweepRun:
    """Train on a table of pictures, settings and seeds, each in a process of its own.

    The table is a TOML file (docs/guide/farm.md). What is done already is left as it is, and what
    was interrupted goes on. The report lies beside the runs.
    """

    table: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="TABLE")]
    """The table: a TOML file."""
    processes: int = 1
    """Trainings at a time; they share the processor's cores."""
    memory_budget: str = "auto"
    """Memory for all of them together, such as 12GB; auto takes what is free."""
    only: str | None = None
    """Do this training alone, by its name, in this process."""
    report: bool = False
    """Write the report only."""

    def __post_init__(self) -> None:
        if self.processes < 1:
            raise OptionError(f"`processes` {self.processes}: at least 1 is needed")
        if self.only is not None and (self.report or self.processes > 1):
            raise OptionError("`only`: one training, without `report` and `processes`")


def run_sweep(arguments: Sequence[str]) -> None:
    """Read the options, train, and write the report.

    Raises:
        OptionError: If a training failed; the others are done.
    """
    from vnca.farm.sweep import Sweep, shared_budget, train_all  # loads torch

    options = parse("sweep", SweepRun, arguments)
    sweep = Sweep.load(options.table)
    if options.only is not None:
        sweep.train(sweep.named(options.only), options.memory_budget, Terminal())
        return
    failed: list[str] = []
    if not options.report:
        budget = shared_budget(options.memory_budget, options.processes)
        failed = train_all(sweep, options.processes, budget, Terminal())
    made("report", sweep.report())
    if failed:
        raise OptionError(f"{options.table}: failed: {', '.join(failed)}")


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Predict what painting a sequence takes, from the headers of its files.

    Cells are counted without reading values, and are bounds from above: smoke too thin to count is
    among them. What a cell costs is measured on this machine, once, in a minute or less.
    """

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEQUENCE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    model: Path | None = None
    """A model file, or the folder of a training run."""
    style: str | None = None
    """A style of the library in the place of a model."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    refine: int = 1
    """Paint on a grid so many times as fine as that of the smoke, at most 8."""
    machines: int = 1
    """Machines like this one that share the frames."""
    chunk_size: int = 16
    """Frames that each of several machines paints at a time."""
    preroll: int | None = None
    """Frames that are stepped through before a chunk; all of them unless given."""
    tile: int | None = None
    """Paint by tiles of so many cells along an edge: memory is theirs."""
    halo: int = 4
    """Cells of the ghost zone of a tile: steps between two exchanges."""
    ranks: int | None = None
    """Ranks of MPI that share the tiles: tells what they send each other."""
    again: bool = False
    """Measure the costs again."""
    json: bool = False
    """Print an object in JSON instead of lines."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        require_refinement(self.refine)
        if (self.model is None) == (self.style is None):
            raise OptionError("`model`, `style`: expected one of them")
        if self.ranks is not None and self.tile is None:
            raise OptionError("`ranks`: share tiles; give `tile`, too")
        for name in ("machines", "chunk_size", "halo", "ranks"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise OptionError(f"`{name}` {value}: at least 1 is needed")
        if self.preroll is not None and self.preroll < 0:
            raise OptionError(f"`preroll` {self.preroll}: must not be negative")
        if self.tile is not None and (self.tile < self.halo or self.tile < 1 or self.tile % 8):
            raise OptionError(
                f"`tile` {self.tile}: expected a multiple of 8, at least `halo` {self.halo}"
            )


def run_plan(arguments: Sequence[str]) -> None:
    """Read the options, count, and say what painting takes."""
    options = parse("plan", Plan, arguments)
    watch = Terminal()
    model = load_style(str(options.style)) if options.model is None else Model.load(options.model)
    config = model.rule.config
    sequence = open_sequence(options.sequence, options.frames, watch)
    region = sequence_region(sequence, options.smoke, watch)
    kind = config.domain
    counts = list(counted(sequence, options.smoke, region, config.dilation, kind))
    half = any(count.half for count in counts)
    costs = measured_costs(model, options.refine, watch, half=half, again=options.again)
    exchange = None
    finer = model.rule.decoder is not None
    sizes = {"grid": 1 if finer else options.refine, "finer": options.refine if finer else 1}
    most_smoke = max(count.smoke for count in counts)
    if options.tile is not None:
        fullest = max(zip(counts, sequence, strict=True), key=lambda each: each[0].cells)[1]
        alive = around(active_cells(fullest, options.smoke).cells, config.dilation)
        exchange = exchanged(alive, options.tile, options.halo, options.ranks)
        most_smoke = min(most_smoke, exchange.largest)
    plan = planned(
        counts,
        costs,
        memory=bytes_needed(most_smoke, **sizes),
        machines=options.machines,
        chunk=options.chunk_size if options.machines > 1 else 0,
        preroll=options.preroll,
    )
    rounds = -(-config.steps_per_frame // options.halo)
    if options.json:
        told: dict[str, Any] = {"frames": [count._asdict() for count in counts]}
        told |= {"costs": asdict(costs), "plan": asdict(plan)}
        if exchange is not None:
            told["exchange"] = exchange._asdict() | {"rounds": rounds}
        print_json(told)
        return
    most, mean = max(counts, key=lambda c: c.cells), sum(c.cells for c in counts) / len(counts)
    print(
        f"{len(counts)} frames, at most {most.cells:,} cells of the automaton "
        f"(frame {most.frame}), {mean:,.0f} on average"
    )
    print(
        f"time    {clock(plan.seconds)} on this machine, {plan.seconds / len(counts):.2f} s a frame"
    )
    if options.machines > 1:
        print(f"        {clock(plan.elapsed)} on {plan.machines} like it, in chunks")
    print(f"memory  {plan.memory / 1e9:.2f} GB on each machine")
    print(f"disk    {plan.disk / 1e9:.2f} GB of painted files")
    if exchange is not None:
        sent = exchange.ghosts * config.channels * 4
        print(
            f"tiles   {exchange.tiles} of {options.tile}³ cells, the largest with "
            f"{exchange.largest:,} of them, ghosts included; "
            f"{exchange.around / exchange.cells:.0%} more cells at the beginning of each "
            f"{options.halo} steps"
        )
        whose = "tiles" if options.ranks is None else f"{exchange.ranks} ranks"
        print(
            f"ranks   between {whose}, {rounds} times a frame, {exchange.messages} messages of "
            f"{sent / 1e6:.1f} MB together; the busiest has {exchange.busiest:,} cells"
        )
