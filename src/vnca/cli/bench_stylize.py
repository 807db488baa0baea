"""`vnca bench stylize`."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from vnca.bench.measurement import run_facts
from vnca.bench.stylize import (
    BACKENDS,
    PaintedSequence,
    available,
    measure_stylizing,
    random_rule,
    simulated,
)
from vnca.cli.bench_options import Rows, Tables, parse_bench, short
from vnca.cli.options import say
from vnca.cli.watch import Terminal
from vnca.core.errors import OptionError
from vnca.engine.native.step import default_threads
from vnca.engine.session import Compute, choose
from vnca.io.smoke import SmokeFormat, with_fitted_scale
from vnca.recipe.sequence import open_sequence
from vnca.rule.model import Model


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
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        for name in ("length", "hidden", "threads", "repeats"):
            if getattr(self, name) < 1:
                raise OptionError(f"--{name} {getattr(self, name)}: at least 1 is needed")
        if self.steps_per_frame is not None and self.steps_per_frame < 1:
            raise OptionError(f"--steps-per-frame {self.steps_per_frame}: at least 1 is needed")
        if (self.model is None) != (self.sequence is None):
            raise OptionError("--model and --sequence: give both or neither")
        if not set(self.backends) <= set(BACKENDS):
            raise OptionError(
                f"--backends {','.join(self.backends)}: expected of {', '.join(BACKENDS)}"
            )


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure."""
    bench_stylize(parse_bench("stylize", BenchStylize, arguments))


def bench_stylize(options: BenchStylize) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written, or backends disagree.
    """
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
        rule = Model.load(options.model).rule
        sequence = open_sequence(options.sequence, options.frames, Terminal())
        smoke = with_fitted_scale(options.smoke, sequence)
    return PaintedSequence.read(rule, sequence, smoke, steps=options.steps_per_frame)


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
