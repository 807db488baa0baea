"""What painting a sequence takes of a machine, or of many: time, memory, disk and messages.

Cells are counted in the files' headers (`count.py`). What a cell costs is measured on this machine:
two small sequences of different sizes are painted by the very program, with the same model, and a
line is drawn through each of time and disk. The costs are kept in the cache. Memory is what tiles
are chosen by, too (`bytes_needed`).
"""

import hashlib
import heapq
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import vnca
from vnca.core.errors import OptionError
from vnca.core.files import cache_folder, whole_file
from vnca.core.volume import Volume
from vnca.farm.count import Count, active_cells, around
from vnca.io import SmokeFormat, write_smoke
from vnca.io.sequence import Frame
from vnca.recipe import Watch
from vnca.rule.model import MODEL_NAME, Model

_RADII = 12, 28
_FRAMES = 4


@dataclass(frozen=True)
class Line:
    """A cost: so much at least, and so much for each cell."""

    least: float
    a_cell: float

    def at(self, cells: float) -> float:
        """For so many cells."""
        return self.least + self.a_cell * cells

    @classmethod
    def through(cls, cells: Sequence[float], costs: Sequence[float]) -> "Line":
        """The line through two costs; never below what one of them was, nor falling."""
        slope = max(0.0, (costs[1] - costs[0]) / (cells[1] - cells[0]))
        return cls(max(0.0, costs[0] - slope * cells[0]), slope)


@dataclass(frozen=True)
class Costs:
    """What a frame costs on a machine, by cells of the automaton on the grid of the smoke.

    Attributes:
        begin: Seconds that the first frame takes beyond those of a frame: until the program is
            there, and for the steps before it is painted.
        seconds: Of a frame.
        disk: Bytes that are written, without what is copied.
    """

    begin: Line
    seconds: Line
    disk: Line


def measured_costs(
    model: Model, refine: int, watch: Watch, *, half: bool = False, again: bool = False
) -> Costs:
    """The costs of painting with a model on this machine; from the cache if they are known.

    Args:
        model: The model.
        refine: How many times as fine as the smoke's the grid of the painting is.
        watch: Is told that it takes a moment.
        half: Whether files hold half floats.
        again: Measure again.

    Raises:
        OptionError: If the painting fails.
    """
    rule = model.rule
    what = [
        vnca.__version__,
        platform.processor() or platform.machine(),
        os.cpu_count(),
        refine,
        half,
        rule.decoder is not None,
        asdict(rule.config),
    ]
    name = hashlib.blake2b(json.dumps(what).encode(), digest_size=8).hexdigest()
    path = cache_folder() / f"costs_{name}.json"
    if not again and (known := _kept(path)) is not None:
        return known
    watch.note("measuring what a cell costs on this machine, once; vnca plan `again` does it again")
    radii = [max(6, round(radius / refine**0.5)) for radius in _RADII]
    found = [_trial(model, radius, refine, half=half) for radius in radii]
    cells = [trial.cells for trial in found]
    costs = Costs(
        Line.through(cells, [trial.begin for trial in found]),
        Line.through(cells, [trial.seconds for trial in found]),
        Line.through(cells, [trial.disk for trial in found]),
    )
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(asdict(costs)), encoding="utf-8")
    return costs


def _kept(path: Path) -> Costs | None:
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        return Costs(**{name: Line(**told[name]) for name in ("begin", "seconds", "disk")})
    except (OSError, ValueError, KeyError, TypeError):
        return None


@dataclass(frozen=True)
class _Trial:
    cells: int
    begin: float
    seconds: float
    disk: float


def _trial(model: Model, radius: int, refine: int, *, half: bool) -> _Trial:
    """Paint a ball of smoke that rises by a cell a frame, and measure that."""
    rule = model.rule
    density, dilation = rule.scales.density, rule.config.dilation
    with tempfile.TemporaryDirectory() as name:
        folder, out = Path(name) / "smoke", Path(name) / "out"
        at = np.indices(3 * (2 * radius + 1,)) - radius
        ball = np.linalg.norm(at, axis=0) <= radius
        rise = np.zeros((*ball.shape, 3), np.float32)
        rise[..., 2] = ball
        for frame in range(_FRAMES):
            place = (0, 0, frame)
            smoke = Volume(np.float32(density) * ball, rise, place, np.eye(4), frame=frame)
            write_smoke(folder / f"ball_{frame}.vdb", smoke, half=half)
        model.save(Path(name) / MODEL_NAME)
        words = [sys.executable, "-m", "vnca", "stylize", name, str(folder)]
        words += ["--out", str(out), "--refine", str(refine), "--velocity-units", "cells/frame"]
        begun = time.time()
        done = subprocess.run(words, stderr=subprocess.PIPE, text=True, errors="replace")
        if done.returncode:
            raise OptionError(f"vnca plan: a trial failed: {' '.join(done.stderr.split())}")
        painted = sorted(out.glob("*.vdb"))
        ends = [path.stat().st_mtime for path in painted]
        alive, sizes = [], []
        for number, target in enumerate(painted):
            active = active_cells(Frame(number, folder / target.name), SmokeFormat())
            alive.append(int(around(active.cells, dilation).values.sum()))
            sizes.append(target.stat().st_size - active.copied)
    seconds = (ends[-1] - ends[0]) / (len(ends) - 1)
    begin = max(0.0, ends[0] - begun - seconds)
    return _Trial(alive[-1], begin, seconds, sizes[-1])


@dataclass(frozen=True)
class Plan:
    """What painting takes.

    Attributes:
        seconds: On one machine.
        machines: How many share the frames.
        elapsed: Seconds on so many.
        memory: Bytes on each, at most at a time.
        disk: Bytes of the painted files.
    """

    seconds: float
    machines: int
    elapsed: float
    memory: int
    disk: int


def planned(
    counts: Sequence[Count],
    costs: Costs,
    *,
    memory: int,
    machines: int = 1,
    chunk: int = 0,
    preroll: int | None = 0,
) -> Plan:
    """What painting frames takes.

    Args:
        counts: Their cells.
        costs: Those of a machine.
        memory: Bytes of a program at most.
        machines: How many share the work, each a chunk at a time.
        chunk: Frames in a chunk; all unless given.
        preroll: Frames stepped through before each chunk but the first, at most; None for all.
    """
    times = [costs.seconds.at(count.cells) for count in counts]

    def taken(first: int, stop: int) -> float:
        begin = 0 if preroll is None else max(0, first - preroll)
        return costs.begin.at(counts[begin].cells) + sum(times[begin:stop])

    count, size = len(counts), chunk or len(counts)
    busy = [0.0] * machines
    for first in range(0, count, size):
        # Whoever is free first takes the next.
        heapq.heapreplace(busy, busy[0] + taken(first, min(count, first + size)))
    return Plan(
        taken(0, count),
        machines,
        max(busy),
        memory,
        round(sum(costs.disk.at(count.cells) + count.copied for count in counts)),
    )
