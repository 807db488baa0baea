"""Painting a frame of the paper's size, from file to file: seconds, beside those of the paper."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from vnca.bench import peak_mb
from vnca.bench.contenders import smoke
from vnca.bench.stylize import random_rule, sequence_painter
from vnca.core import Box, Index
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.engine import Compute
from vnca.io import SmokeFormat, read_smoke, write_smoke
from vnca.io.sequence import FrameSequence, find_frames
from vnca.painting import Roll, StylizeConfig
from vnca.painting.painter import Painter

PAPER_SECONDS = 0.8
"""Of a frame of 200×300×200 cells on an RTX 3090 Ti (VNCA, table 1)."""


@dataclass(frozen=True, kw_only=True)
class PaintCase:
    """What is painted.

    Attributes:
        grid: Cells along x, y and z.
        occupancy: Share of them that hold smoke.
        frames: How many; the first one is not counted, since nothing is ready for it.
        steps: Of the automaton in each.
        hidden: Units of the rule.
    """

    grid: Index
    occupancy: float
    frames: int
    steps: int
    hidden: int

    def write(self, folder: Path) -> FrameSequence:
        """A column of smoke that moves by a cell a frame, so that other cells live in each."""
        density, active = smoke(self.grid, self.occupancy)
        velocity = np.zeros((*self.grid, 3), np.float32)
        velocity[active] = 0, 1, 0
        for frame in range(self.frames):
            volume = Volume(density, velocity, (0, frame, 0), np.eye(4), frame)
            write_smoke(folder / f"column_{frame:04d}.vdb", volume)
        return find_frames(folder)

    @property
    def box(self) -> Box:
        """Holds all frames."""
        x, y, z = self.grid
        return Box((0, 0, 0), (x, y + self.frames - 1, z))


def measure_painting(
    case: PaintCase, precisions: Sequence[str], *, threads: int, device: str = "cpu"
) -> list[dict[str, Any]]:
    """A row for each precision: seconds a frame, reading and writing included, and memory.

    Beside them stand the seconds of all processors together, which other work on the machine
    changes little.
    """
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        sequence = case.write(Path(folder))
        lattice = Lattice(np.eye(4))
        first = read_smoke(sequence[0].path, SmokeFormat(), lattice=lattice)
        for precision in precisions:
            config = StylizeConfig(steps_per_frame=case.steps, warmup=0)
            compute = Compute("auto", device, precision, threads)
            roll = Roll(random_rule(case.hidden), config, case.box, compute)
            out = Path(folder) / precision
            out.mkdir()
            painter = sequence_painter(sequence, roll, lattice, SmokeFormat(), out)
            taken: list[tuple[float, float]] = []
            peak = peak_mb(lambda kept=taken, of=painter: kept.extend(_times(of)), "cpu")
            counted, busy = zip(*taken[1:], strict=True)
            rows.append(
                {
                    "grid": "x".join(map(str, case.grid)),
                    "occupancy": case.occupancy,
                    "cells": len(roll.domain(first)),
                    "steps": case.steps,
                    "hidden": case.hidden,
                    "dtype": precision,
                    "seconds_min": round(min(counted), 3),
                    "seconds": round(median(counted), 3),
                    "seconds_max": round(max(counted), 3),
                    "processor_seconds": round(median(busy), 3),
                    "peak_mb": peak,
                    "paper_seconds": PAPER_SECONDS,
                }
            )
    return rows


def _times(painter: Painter) -> Iterator[tuple[float, float]]:
    """Seconds from one finished frame to the next, of the clock and of the processors."""
    begin = painter.begin(resume=False, overwrite=True)
    last, busy = time.perf_counter(), time.process_time()
    with closing(painter.paint(begin)) as paths:
        for _ in paths:
            now, used = time.perf_counter(), time.process_time()
            yield now - last, used - busy
            last, busy = now, used
    painter.discard()
