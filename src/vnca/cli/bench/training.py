"""`vnca bench step` and `vnca bench train`, which need torch."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path

import torch

from vnca.bench import run_facts
from vnca.bench.contenders import TRAINABLE, available, require
from vnca.bench.step import PEAKS, TOLERANCES, StepConfig, StepRun, measure_steps, prepare
from vnca.bench.train import Training, measure_training
from vnca.cli.bench import Rows, Tables, parse_bench, short
from vnca.cli.demo import STYLE
from vnca.cli.terminal import Terminal, say
from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.core.memory import memory_budget
from vnca.core.volume import Volume
from vnca.engine.native import default_threads
from vnca.engine.tensors import choose_device
from vnca.features import load_network
from vnca.io import SmokeFormat, missing_velocity
from vnca.io.picture import read_style
from vnca.io.smoke_format import NO_VELOCITY
from vnca.recipe.sequence import beside, read_alone
from vnca.simulation import simulate
from vnca.training.config import SmokeConfig
from vnca.training.presets import DEFAULT, preset


@dataclass(frozen=True)
class Step(Tables):
    """Time one step of the automaton in every backend, in turns, in one run.

    Times are per active cell. GFLOP/s count the matrix products that are needed, the same for
    every backend. If backends disagree with the reference in float64, nothing is timed.
    """

    config: StepConfig = field(default_factory=StepConfig)
    """What is measured."""


def run_step(arguments: Sequence[str]) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written, or backends disagree.
    """
    options = parse_bench("step", Step, arguments)
    options.require_writable()
    facts = prepare(options.config)
    options.print("{device}, {threads} threads, torch {torch}, vnca {vnca}".format(**facts))
    rows = []
    for run in measure_steps(options.config):
        options.print("\n".join(_step_table(run)))
        rows += run.rows
    peaks = {name: rows[0][name] for name in ("peak_gflops", "copy_gbs")}
    options.keep(facts, rows, peaks)


def _step_table(run: StepRun) -> list[str]:
    first, plain = run.rows[0], {r["pass"]: r for r in run.rows if r["backend"] == "plain"}
    to_state, to_gradients = TOLERANCES[run.dtype]
    lines = [
        "",
        f"{run.dtype}, {first['grid']} cells, {first['occupancy']:.1%} active, hidden "
        f"{first['hidden']}",
        f"peaks: {PEAKS[run.peak_of]} {run.peak_gflops:.1f} GFLOP/s, copy {run.copy_gbs:.1f} GB/s",
        f"all agree with the reference in float64: states to {to_state:.0e}, gradients to "
        f"{to_gradients:.0e} of their norm",
        f"{'backend':10}{'pass':9}{'ns a cell (min to max)':>32}{'GFLOP/s':>10}{'of peak':>9}"
        f"{'of copy':>9}{'MB':>9}{'against plain':>15}",
    ]
    for row in run.rows:
        took = short(row["ns_per_cell"])
        spread = f"({short(row['ns_per_cell_min'])} to {short(row['ns_per_cell_max'])})"
        gain = ""
        if row["pass"] in plain:
            gain = f"{plain[row['pass']]['ns_per_cell'] / row['ns_per_cell']:.1f}×"
        lines.append(
            f"{row['backend']:10}{row['pass']:9}{took:>10} {spread:>21}"
            f"{row['gflops']:>10.1f}{row['share_of_peak']:>9.1%}{row['share_of_copy']:>9.1%}"
            f"{short(row['peak_mb']):>9}{gain:>15}"
        )
    return lines


_FRAME = 30
"""Of the simulated plume: it has risen through most of its box."""


@dataclass(frozen=True)
class BenchTrain(Tables):
    """Time iterations of real training in every backend, in turns, in one run.

    Trains on a simulated plume and a painting of the package unless others are given. Every
    rollout begins from a grown state and takes equally many steps.
    """

    frame: Path | None = None
    """A frame of smoke; a simulated one unless given."""
    style: Path | None = None
    """A picture; one of the package unless given."""
    resolution: int = 48
    """Cells across the simulated plume."""
    preset: str = DEFAULT
    """Sizes of what is trained: draft, standard, paper, or a TOML file."""
    hidden: int | None = None
    """Hidden units; the preset's unless given."""
    rollout: int | None = None
    """Steps of a rollout; the mean of the preset's unless given."""
    view_size: int | None = None
    """Rows and columns of a view, pixels; the preset's unless given."""
    backends: tuple[str, ...] = ()
    """Of plain, compile, reference, native and triton; all that can run here unless given."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    memory_budget: str = "auto"
    """As of `vnca train`; with a size, name one backend: all that take part share it."""
    threads: int = default_threads()
    """Of the CPU; as many as it has cores unless given."""
    repeats: int = 5
    """Iterations that are timed."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        memory_budget(self.memory_budget)
        for name in ("hidden", "rollout", "threads", "repeats"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise OptionError(f"--{name} {value}: at least 1 is needed")
        if not set(self.backends) <= set(TRAINABLE):
            raise OptionError(
                f"--backends {','.join(self.backends)}: expected of {', '.join(TRAINABLE)}"
            )

    @property
    def config(self) -> SmokeConfig:
        """The hyperparameters."""
        plan = preset(SmokeConfig, self.preset)
        rollout = self.rollout or (plan.shortest_rollout + plan.longest_rollout) // 2
        return replace(
            plan,
            rule=replace(plan.rule, hidden=self.hidden or plan.rule.hidden),
            view=replace(plan.view, size=self.view_size or plan.view.size),
            shortest_rollout=rollout,
            longest_rollout=rollout,
        )


def run_train(arguments: Sequence[str]) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written, or backends disagree.
    """
    options = parse_bench("train", BenchTrain, arguments)
    options.require_writable()
    device, config = choose_device(options.device), options.config
    for name in options.backends:
        require(name, "float32", device.type)
    torch.set_num_threads(options.threads)
    facts = run_facts(device.type, options.threads)
    network = load_network(config.features, device)
    budget = memory_budget(options.memory_budget)
    training = Training(_smoke(options), _style(options), config, network, device, budget)
    able = tuple(name for name in available("float32", device.type) if name in TRAINABLE)
    rows = measure_training(training, options.backends or able, repeats=options.repeats)
    rows = [{**row, "preset": options.preset} for row in rows]
    options.print("{device}, {threads} threads, torch {torch}, vnca {vnca}".format(**facts))
    options.print("\n".join(_training_table(rows)))
    options.keep(facts, rows)


def _smoke(options: BenchTrain) -> Volume:
    if options.frame is not None:
        frame = read_alone(options.frame, beside(options.frame, options.smoke), Terminal())
        if frame.velocity_field is None and options.smoke.velocity_grid != NO_VELOCITY:
            Terminal().note(f"{missing_velocity(options.frame)}; teaching motion is not timed")
        return frame
    say("simulating a plume")
    *_, frame = simulate("plume", resolution=options.resolution, frames=_FRAME, seed=0)
    return frame


def _style(options: BenchTrain) -> FloatArray:
    with as_file(files("vnca.data") / STYLE) as own:
        return read_style(options.style or own)


def _training_table(rows: Rows) -> list[str]:
    first = rows[0]
    lines = [
        f"{first['preset']}: {first['cells']} active cells in {first['grid']}, hidden "
        f"{first['hidden']}, {first['rollout']} steps a rollout, views of {first['view']}²",
        "all come to the same loss",
        f"{'backend':10}{'seconds an iteration (min to max)':>36}{'MB':>10}{'against plain':>15}",
    ]
    slow = [row["seconds"] for row in rows if row["backend"] == "plain"]
    for row in rows:
        spread = f"({short(row['seconds_min'])} to {short(row['seconds_max'])})"
        gain = f"{slow[0] / row['seconds']:.1f}×" if slow else ""
        lines.append(
            f"{row['backend']:10}{short(row['seconds']):>14} {spread:>21}"
            f"{short(row['peak_mb']):>10}{gain:>15}"
        )
    return lines
