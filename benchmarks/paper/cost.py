"""What it costs: a whole training, and a frame painted and looked at.

Run `python benchmarks/paper/cost.py --out DIR` on a machine that does nothing else; `--full` is as
large as the paper. The reference is trained anew for each seed, from reading its inputs to its
last preview. Then it paints a frame again and again, as if it were so many of a sequence: on the
CPU, as `vnca stylize` does, computing only.

Reference: VNCA section 4.2, "Runtime Comparison": 0.8 s to stylize a frame of 200×300×200 cells on
an RTX 3090 Ti.
"""

import time
from dataclasses import dataclass

from judge import AROUND, PAINTED, Judge, magnified
from study import REFERENCE, Findings, Study, run

from vnca.bench import peak_mb
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.painting import Roll
from vnca.rule import Rule
from vnca.training.scenes.smoke import smoke_bounds

PAPERS_GRID = 3.125
"""So many times finer, the 64×64×96 cells around the frame of the tests are 200×200×300."""


@dataclass(frozen=True)
class Cost(Study):
    """What is timed, and how often."""

    magnify: float | None = None
    """How many times finer the grid that is painted is than that of the frame, in each direction;
    3.125, about the paper's, if --full, else 1."""
    repeats: int = 20
    """Frames painted and looked at."""
    picture_size: int = 384
    """Rows and columns of a picture, pixels."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.repeats < 1:
            raise OptionError(f"--repeats {self.repeats}: at least 1 is needed")


def measure(study: Cost) -> None:
    findings, judge = Findings(study, "cost"), Judge(study)
    smoke = magnified(study.volume, study.magnify or (PAPERS_GRID if study.full else 1.0))
    grid = "×".join(map(str, smoke.density.shape))
    for seed in study.seeds:
        findings.add(REFERENCE, training(study, seed), seed=seed)
        rule = study.trained(REFERENCE, study.config, seed)
        findings.add(REFERENCE, painting(study, judge, rule, smoke), seed=seed, on=grid)
    findings.tell()


def training(study: Cost, seed: int) -> dict[str, float]:
    """Seconds of a training, and the memory it took, where that can be known."""

    def train() -> None:
        study.trained(REFERENCE, study.config, seed, anew=True)

    begun = time.perf_counter()
    peak = peak_mb(train, study.place.type)
    found = {"training, s": time.perf_counter() - begun}
    return found if peak is None else {**found, "training, MB": peak}


def painting(study: Cost, judge: Judge, rule: Rule, smoke: Volume) -> dict[str, float]:
    """Seconds of a frame, and how many cells it has."""
    roll = Roll(rule, PAINTED, smoke_bounds(smoke, rule.scales.density))
    latest = roll.paint(smoke, roll.start())
    begun = time.perf_counter()
    for _ in range(study.repeats):
        latest = roll.paint(smoke, latest.state)
    painted = time.perf_counter()
    for repeat in range(study.repeats):
        viewpoint = AROUND[repeat % len(AROUND)]
        judge.look(latest, rule, viewpoint, size=study.picture_size).colour.cpu()
    looked = time.perf_counter()
    return {
        "cells": len(latest.state.cells),
        "painting, s a frame": (painted - begun) / study.repeats,
        "looking, s a picture": (looked - painted) / study.repeats,
    }


if __name__ == "__main__":
    run(Cost, measure, __doc__)
