"""`vnca bench train`."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Literal

import torch
import tyro

from vnca.bench.contenders import available, require
from vnca.bench.measurement import run_facts
from vnca.bench.train import Training, measure_training
from vnca.cli.bench_options import Rows, Tables, parse_bench, short
from vnca.cli.demo import STYLE
from vnca.cli.options import say
from vnca.cli.watch import Terminal
from vnca.core.errors import OptionError
from vnca.core.typing import FloatArray
from vnca.core.volume import Volume
from vnca.engine.native.step import default_threads
from vnca.features.load import load_network
from vnca.io.picture import read_style
from vnca.io.smoke import SmokeFormat
from vnca.recipe.sequence import beside, read_alone
from vnca.recipe.session import choose_device
from vnca.simulation import simulate
from vnca.training.memory import memory_budget
from vnca.training.smoke_config import PRESETS, SmokeConfig

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
    preset: Literal["draft", "standard", "paper"] = "draft"
    """Sizes of what is trained."""
    hidden: int | None = None
    """Hidden units; the preset's unless given."""
    rollout: int | None = None
    """Steps of a rollout; the mean of the preset's unless given."""
    view_size: int | None = None
    """Rows and columns of a view, pixels; the preset's unless given."""
    backends: tuple[str, ...] = ()
    """Of plain, compile, reference, native and triton; all that can run here unless given."""
    device: str = "auto"
    """Where to train: auto, cpu or cuda."""
    memory_budget: str = "auto"
    """As of `vnca train`; with a size, name one backend: all that take part share it."""
    threads: int = default_threads()
    """Of the CPU; as many as it has cores unless given."""
    repeats: int = 5
    """Iterations that are timed."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        memory_budget(self.memory_budget)
        for name in ("hidden", "rollout", "threads", "repeats"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise OptionError(f"--{name} {value}: at least 1 is needed")

    @property
    def config(self) -> SmokeConfig:
        """The hyperparameters."""
        preset = PRESETS[self.preset]
        rollout = self.rollout or (preset.shortest_rollout + preset.longest_rollout) // 2
        return replace(
            preset,
            rule=replace(preset.rule, hidden=self.hidden or preset.rule.hidden),
            view=replace(preset.view, size=self.view_size or preset.view.size),
            shortest_rollout=rollout,
            longest_rollout=rollout,
        )


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure."""
    bench_train(parse_bench("train", BenchTrain, arguments))


def bench_train(options: BenchTrain) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written, or backends disagree.
    """
    options.require_writable()
    device, config = choose_device(options.device), options.config
    for name in options.backends:
        require(name, "float32", device.type)
    torch.set_num_threads(options.threads)
    facts = run_facts(device.type, options.threads)
    network = load_network(config.features, device)
    budget = memory_budget(options.memory_budget)
    training = Training(_smoke(options), _style(options), config, network, device, budget)
    rows = measure_training(
        training,
        options.backends or available("float32", device.type),
        repeats=options.repeats,
    )
    rows = [{**row, "preset": options.preset} for row in rows]
    options.print("{device}, {threads} threads, torch {torch}, vnca {vnca}".format(**facts))
    options.print("\n".join(_table(rows)))
    options.keep(facts, rows)


def _smoke(options: BenchTrain) -> Volume:
    if options.frame is not None:
        return read_alone(options.frame, beside(options.frame, options.smoke), Terminal())
    say("simulating a plume")
    *_, frame = simulate("plume", resolution=options.resolution, frames=_FRAME, seed=0)
    return frame


def _style(options: BenchTrain) -> FloatArray:
    with as_file(files("vnca.data") / STYLE) as own:
        return read_style(options.style or own)


def _table(rows: Rows) -> list[str]:
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
