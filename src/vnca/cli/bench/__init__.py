"""`vnca bench {step,train,stylize,paint}`: what vnca costs on the machine at hand.

`vnca bench stylize` and `vnca bench paint` are here; the former runs without torch.
"""

import math
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from vnca.bench import append_csv, run_facts, write_json
from vnca.bench.stylize import (
    BACKENDS,
    PaintedSequence,
    available,
    measure_stylizing,
    random_rule,
    simulated,
)
from vnca.cli.options import STDOUT, parse, print_json, run_subcommand
from vnca.cli.terminal import Terminal, say
from vnca.core import Index
from vnca.core.errors import OptionError
from vnca.core.files import writable_file
from vnca.engine import PRECISIONS, Compute, choose, device_named
from vnca.engine.native import default_threads, unavailable
from vnca.io import SmokeFormat, with_fitted_scale
from vnca.recipe.sequence import open_sequence
from vnca.rule.model import Model

COMMANDS = {
    "step": "time one step of the automaton in every backend",
    "train": "time iterations of training",
    "stylize": "time frames of painting a sequence",
    "paint": "time frames of the paper's size, from file to file",
}
_HOMES = {
    "step": "bench.training:run_step",
    "train": "bench.training:run_train",
    "stylize": "bench:run_stylize",
    "paint": "bench:run_paint",
}


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands."""
    purpose = "Measure what vnca costs on this machine."
    run_subcommand("bench", purpose, COMMANDS, _HOMES, arguments)


T = TypeVar("T")
Rows = Sequence[Mapping[str, Any]]
_RULES = ConstructorRegistry()


def parse_bench(command: str, options: Callable[..., T], arguments: Sequence[str]) -> T:
    """As `parse`, with grids written as XxYxZ and names divided by commas."""
    with _RULES:
        return parse(f"bench {command}", options, arguments, separator=",")


@_RULES.primitive_rule
def _grid(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Index] | None:
    if get_args(asked.type) != (int, int, int):
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="XxYxZ",
        instance_from_str=lambda words: _index(words[0]),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda grid: ["x".join(map(str, grid))],
    )


@_RULES.primitive_rule
def _names(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[tuple[str, ...]] | None:
    if get_args(asked.type) != (str, ...):
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="NAME,…",
        instance_from_str=lambda words: tuple(words[0].split(",")),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda names: [",".join(names)],
    )


def _index(text: str) -> Index:
    numbers = text.split("x")
    if len(numbers) != 3 or not all(number.isdecimal() for number in numbers):
        raise OptionError(f"--grid {text}: expected cells along x, y and z, such as 64x64x96")
    x, y, z = map(int, numbers)
    return x, y, z


@dataclass(frozen=True)
class Tables:
    """Where what is measured is kept."""

    json: Path | None = None
    """Write the rows of this run here; - prints them, and the table on standard error."""
    csv: Path | None = None
    """Add the rows to this table."""

    def require_writable(self) -> None:
        """Refuse files that could not be written when all is measured.

        Raises:
            OutputError: If there is one.
        """
        for path in (None if self.json == STDOUT else self.json, self.csv):
            if path is not None:
                writable_file(path)

    def print(self, text: str) -> None:
        """Show a part of a table: on standard error where JSON is printed."""
        print(text, file=sys.stderr if self.json == STDOUT else sys.stdout)

    def keep(
        self, facts: Mapping[str, Any], rows: Rows, peaks: Mapping[str, Any] | None = None
    ) -> None:
        """Write the rows where they are asked for.

        Args:
            facts: What all rows share.
            rows: What was measured.
            peaks: Of the machine, for the object in JSON.

        Raises:
            VncaError: If a file cannot be written.
        """
        if self.json == STDOUT:
            print_json({**facts, **(peaks or {}), "rows": rows})
        elif self.json is not None:
            write_json(self.json, {**facts, **(peaks or {})}, rows)
        if self.csv is not None:
            append_csv(self.csv, facts, rows)


def short(value: float | None) -> str:
    """Three digits, or all before the point; nothing for what could not be measured."""
    if value is None:
        return ""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


@dataclass(frozen=True)
class BenchStylize(Tables):
    """Time frames of painting a sequence, computing only and with files, in every backend.

    Paints a simulated plume with a random rule unless both are given. A random rule costs what a
    trained one does. All frames are held in memory.
    """

    model: Path | None = None
    """A model file, or the folder of a training run; goes with --sequence."""
    sequence: str | None = None
    """A sequence as `vnca stylize` takes it; goes with --model."""
    frames: str | None = None
    """Which of its frames, such as 30-53 or 1,4,7-9; all unless given."""
    resolution: int = 48
    """Cells across the simulated plume."""
    length: int = 8
    """Frames of the simulated plume."""
    hidden: int = 96
    """Hidden units of the random rule."""
    density_scale: float | None = None
    """Density that counts as 1; the model's unless given."""
    steps_per_frame: int | None = None
    """Steps of the automaton in each frame; the rule's own unless given."""
    backends: tuple[str, ...] = ()
    """Of native and numpy; all that can run here unless given."""
    precision: str = "float32"
    """What the native kernel rounds the factors of its products to."""
    threads: int = default_threads()
    """Of the native kernel; as many as there are cores unless given."""
    repeats: int = 3
    """How often the sequence is painted by each backend, in turns."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        for name in ("length", "hidden", "threads", "repeats"):
            if getattr(self, name) < 1:
                raise OptionError(f"--{name} {getattr(self, name)}: at least 1 is needed")
        if self.steps_per_frame is not None and self.steps_per_frame < 1:
            raise OptionError(f"--steps-per-frame {self.steps_per_frame}: at least 1 is needed")
        if self.density_scale is not None and not 0 < self.density_scale < math.inf:
            raise OptionError(f"--density-scale {self.density_scale}: must be positive")
        if (self.model is None) != (self.sequence is None):
            raise OptionError("--model and --sequence: give both or neither")
        if not set(self.backends) <= set(BACKENDS):
            raise OptionError(
                f"--backends {','.join(self.backends)}: expected of {', '.join(BACKENDS)}"
            )


def run_stylize(arguments: Sequence[str]) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written, or backends disagree.
    """
    options = parse_bench("stylize", BenchStylize, arguments)
    options.require_writable()
    backends = options.backends or available()
    for name in backends:  # what cannot run is refused before smoke is simulated
        choose(Compute(name, precision=options.precision if name == "native" else "float32"))
    facts = run_facts("cpu", options.threads)
    with tempfile.TemporaryDirectory() as folder:
        rows = measure_stylizing(
            _painted(options, Path(folder)),
            backends,
            threads=options.threads,
            repeats=options.repeats,
            precision=options.precision,
        )
    options.print("{device}, {threads} threads, vnca {vnca}".format(**facts))
    options.print("\n".join(_table(rows)))
    options.keep(facts, rows)


def _painted(options: BenchStylize, folder: Path) -> PaintedSequence:
    if options.model is None or options.sequence is None:
        say(f"simulating a plume of {options.length} frames")
        rule = random_rule(options.hidden)
        sequence = simulated(folder, resolution=options.resolution, frames=options.length)
        smoke = SmokeFormat()
    else:
        rule = Model.load(options.model).rule.rescaled(density=options.density_scale)
        sequence = open_sequence(options.sequence, options.frames, Terminal())
        smoke = with_fitted_scale(options.smoke, sequence)
    steps = options.steps_per_frame
    return PaintedSequence.read(rule, sequence, smoke, steps=steps, tell=Terminal().note)


def _table(rows: Rows) -> list[str]:
    first = rows[0]
    lines = [
        f"{first['frames']} frames in {first['grid']} cells, {first['cells']} active, "
        f"{first['steps']} steps a frame, hidden {first['hidden']}",
        "all agree on the first frame",
        f"{'backend':10}{'dtype':10}{'':12}{'seconds a frame (min to max)':>32}{'frames/s':>10}"
        f"{'ns a cell and step':>20}{'MB':>8}{'against numpy':>19}",
    ]
    slow = {row["files"]: row["seconds"] for row in rows if row["backend"] == "numpy"}
    for row in rows:
        spread = f"({short(row['seconds_min'])} to {short(row['seconds_max'])})"
        gain = f"{slow[row['files']] / row['seconds']:.1f}×" if slow else ""
        what = "with files" if row["files"] else "computing"
        lines.append(
            f"{row['backend']:10}{row['dtype']:10}{what:12}{short(row['seconds']):>10} {spread:>21}"
            f"{short(row['frames_per_second']):>10}{short(row['ns_per_cell']):>20}"
            f"{short(row['peak_mb']):>8}{gain:>19}"
        )
    return lines


@dataclass(frozen=True)
class BenchPaint(Tables):
    """Time frames of the paper's size, from file to file, beside the paper's 0.8 s on a GPU.

    A column of smoke moves by a cell a frame, so that in each other cells are active. It is
    painted by a random rule, which costs what a trained one does.
    """

    grid: Index = (200, 300, 200)
    """Cells along x, y and z."""
    occupancy: float = 0.15
    """Share of the cells that hold smoke."""
    frames: int = 3
    """How many are painted; the first is not counted."""
    steps: int = 24
    """Of the automaton in a frame."""
    hidden: int = 128
    """Units of the rule."""
    precisions: tuple[str, ...] = ()
    """Of float32 and bfloat16; those that the machine has unless given."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    threads: int = default_threads()
    """Of the CPU; as many as it has cores unless given."""

    def __post_init__(self) -> None:
        if min(self.grid) < 1:
            raise OptionError(f"--grid {'x'.join(map(str, self.grid))}: at least 1x1x1 is needed")
        if not 0 < self.occupancy <= 1:
            raise OptionError(f"--occupancy {self.occupancy}: must be over 0 and at most 1")
        for name, least in (("frames", 2), ("steps", 1), ("hidden", 1), ("threads", 1)):
            if getattr(self, name) < least:
                raise OptionError(f"--{name} {getattr(self, name)}: at least {least} is needed")
        if not set(self.precisions) <= set(PRECISIONS):
            raise OptionError(
                f"--precisions {','.join(self.precisions)}: expected of {', '.join(PRECISIONS)}"
            )


def run_paint(arguments: Sequence[str]) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written.
    """
    from vnca.bench.paint import PaintCase, measure_painting  # loads torch

    options = parse_bench("paint", BenchPaint, arguments)
    options.require_writable()
    device = device_named(options.device)
    there = PRECISIONS if device == "cpu" and unavailable("bfloat16") is None else PRECISIONS[:1]
    facts = run_facts(device, options.threads)
    case = PaintCase(
        grid=options.grid,
        occupancy=options.occupancy,
        frames=options.frames,
        steps=options.steps,
        hidden=options.hidden,
    )
    say(f"painting {case.frames} frames of {'x'.join(map(str, case.grid))} cells")
    chosen = options.precisions or there
    rows = measure_painting(case, chosen, threads=options.threads, device=device)
    first = rows[0]
    options.print("{device}, {threads} threads, vnca {vnca}".format(**facts))
    options.print(
        f"{first['grid']} cells, {first['cells']} active, {first['steps']} steps a frame, "
        f"hidden {first['hidden']}, files included"
    )
    for row in rows:
        spread = f"({short(row['seconds_min'])} to {short(row['seconds_max'])})"
        options.print(
            f"{row['dtype']:10}{short(row['seconds']):>8} s a frame {spread}, "
            f"{short(row['processor_seconds'])} s of processors, at most "
            f"{short(row['peak_mb'])} MB; "
            f"the paper: {row['paper_seconds']} s on an RTX 3090 Ti"
        )
    options.keep(facts, rows)
