"""Painting a sequence in every backend that works on arrays: computing only, and with files."""

import tempfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from vnca.bench import Difference, Spread, in_turns, peak_mb, require_agreement
from vnca.core import Box, FloatArray
from vnca.core.errors import BackendUnavailableError
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.engine import Compute, choose
from vnca.io import SmokeFormat, read_smoke, write_smoke
from vnca.io.sequence import FrameSequence, find_frames
from vnca.io.smoke_format import on_one_lattice
from vnca.painting import Roll, StylizeConfig
from vnca.painting.frames import VelocityCheck, require_dense
from vnca.painting.painter import Painter
from vnca.rule import Rule, RuleConfig, Scales
from vnca.simulation import simulate

BACKENDS = ("native", "numpy")
TOLERANCES: dict[str, float] = {"float32": 1e-3, "bfloat16": 5e-2}
"""Of the state after the first frame: norm of the difference from the first backend over the norm.
A trained rule multiplies what rounding does in tens of steps."""
_LATEST = 3
"""The simulated frames are the last of this many times as many: smoke has risen by then."""


@dataclass(frozen=True)
class PaintedSequence:
    """What is painted again and again.

    Attributes:
        rule: The rule.
        sequence: The files.
        smoke: How they are read.
        volumes: The same frames, read, on one lattice.
        config: How the rule is rolled over them.
    """

    rule: Rule
    sequence: FrameSequence
    smoke: SmokeFormat
    volumes: Sequence[Volume]
    config: StylizeConfig

    @classmethod
    def read(
        cls,
        rule: Rule,
        sequence: FrameSequence,
        smoke: SmokeFormat,
        *,
        steps: int | None,
        tell: Callable[[str], None],
    ) -> "PaintedSequence":
        """The frames of a sequence; all have equally many steps, the first too.

        Args:
            rule: What will paint it.
            sequence: The files.
            smoke: How they are read.
            steps: Of the automaton in each frame; the rule's own if None.
            tell: Is given a line if the rule wants a velocity that a frame does not have.

        Raises:
            VncaError: If a frame cannot be read, or nothing would be painted.
        """
        frames = (read_smoke(f.path, smoke, frame=f.number) for f in sequence)
        check = VelocityCheck(rule, smoke, tell)
        volumes = list(on_one_lattice(check.watched(frames, [f.path for f in sequence])))
        densities = (volume.density_field.values for volume in volumes)
        require_dense(densities, rule.scales.density, str(sequence[0].path.parent))
        config = StylizeConfig(steps_per_frame=steps, warmup=0)
        return cls(rule, sequence, smoke, volumes, config)

    @property
    def lattice(self) -> Lattice:
        """That of the frames."""
        return Lattice(self.volumes[-1].index_to_world)

    def roll(self, backend: str, threads: int, precision: str) -> Roll:
        """The rule in a backend, ready for the sequence."""
        box = reduce(Box.union, (volume.box for volume in self.volumes))
        compute = Compute(backend, precision=precision, threads=threads)
        return Roll(self.rule, self.config, box, compute)


def random_rule(hidden: int, seed: int = 0) -> Rule:
    """A rule that was not trained, but changes all it sees a little."""
    rule = Rule.initial(RuleConfig(hidden=hidden, position_prior=False), Scales(), seed=seed)
    output = np.random.default_rng(seed).normal(0, 0.01, rule.output.shape)
    return replace(rule, output=output.astype(np.float32))


def simulated(folder: Path, *, resolution: int, frames: int) -> FrameSequence:
    """The last frames of a simulated plume, written to a folder.

    Raises:
        VncaError: If they cannot be simulated or written.
    """
    plume = simulate("plume", resolution=resolution, frames=_LATEST * frames, seed=0)
    for volume in islice(plume, (_LATEST - 1) * frames, None):
        write_smoke(folder / f"plume_{volume.frame:04d}.vdb", volume)
    return find_frames(folder)


def available() -> tuple[str, ...]:
    """The backends that can run here."""

    def runs(name: str) -> bool:
        try:
            return choose(Compute(name)).name == name
        except BackendUnavailableError:
            return False

    return tuple(filter(runs, BACKENDS))


def measure_stylizing(
    painted: PaintedSequence,
    backends: Sequence[str],
    *,
    threads: int,
    repeats: int,
    precision: str = "float32",
) -> list[dict[str, Any]]:
    """A row for each backend, computing only and with files: seconds a frame.

    Args:
        painted: What is painted.
        backends: In what.
        threads: How many the native kernel uses.
        repeats: How often each paints it, in turns.
        precision: Of the native kernel's products; the others have only float32.

    Raises:
        BackendUnavailableError: If a backend cannot run here.
        DisagreementError: If backends do not paint the same; then nothing is timed.
    """
    types = {name: precision if name == "native" else "float32" for name in backends}
    rolls = {name: painted.roll(name, threads, dtype) for name, dtype in types.items()}
    first = {name: roll.paint(painted.volumes[0], roll.start()) for name, roll in rolls.items()}
    states = {name: painting.state.values for name, painting in first.items()}
    require_agreement(_differences(states, TOLERANCES[precision]))
    with tempfile.TemporaryDirectory() as folder:
        works: dict[tuple[str, bool], Callable[[], object]] = {}
        for name, roll in rolls.items():
            works[name, False] = partial(_compute, roll, painted.volumes)
            painter = sequence_painter(
                painted.sequence, roll, painted.lattice, painted.smoke, Path(folder)
            )
            works[name, True] = partial(_paint, painter)
        begins = {key: partial(_ready, work) for key, work in works.items()}
        times = in_turns(begins, "cpu", repeats)
        peaks = {key: peak_mb(work, "cpu") for key, work in works.items()}
    roll = rolls[backends[0]]
    cells = round(np.mean(_compute(roll, painted.volumes)))
    frames, steps = len(painted.volumes), int(roll.steps_per_frame)
    rows = []
    for (name, files), taken in times.items():
        spread = Spread.of([seconds / frames for seconds in taken])
        rows.append(
            {
                "backend": name,
                "dtype": types[name],
                "files": files,
                "grid": "x".join(map(str, roll.box.shape)),
                "frames": frames,
                "cells": cells,
                "steps": steps,
                "hidden": painted.rule.config.hidden,
                "seconds_min": round(spread.least, 5),
                "seconds": round(spread.median, 5),
                "seconds_max": round(spread.most, 5),
                "frames_per_second": round(1 / spread.median, 2),
                "ns_per_cell": round(spread.median * 1e9 / (cells * steps), 2),
                "peak_mb": peaks[name, files],
            }
        )
    return rows


def _differences(states: dict[str, FloatArray], allowed: float) -> list[Difference]:
    expected = next(iter(states.values())).astype(float)
    size = np.linalg.norm(expected)
    return [
        Difference(
            name, "state after a frame", float(np.linalg.norm(got - expected) / size), allowed
        )
        for name, got in states.items()
    ]


def _ready(work: Callable[[], object]) -> Callable[[], object]:
    return work


def _compute(roll: Roll, volumes: Sequence[Volume]) -> list[int]:
    """How many cells lived in each frame."""
    state, cells = roll.start(), []
    for volume in volumes:
        state = roll.paint(volume, state).state
        cells.append(len(state.cells))
    return cells


def sequence_painter(
    sequence: FrameSequence, roll: Roll, lattice: Lattice, smoke: SmokeFormat, folder: Path
) -> Painter:
    """What paints a sequence into a folder, and stops at what cannot be read."""
    return Painter(
        sequence,
        folder,
        roll,
        lattice,
        smoke,
        colour_grids=("Cd",),
        on_error="stop",
        conditions={},
        tell=lambda line: None,
    )


def _paint(painter: Painter) -> None:
    with closing(painter.paint(painter.begin(resume=False, overwrite=True))) as paths:
        for _ in paths:
            pass
    painter.discard()
