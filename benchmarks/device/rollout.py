"""What rolling out costs on a GPU: frames painted, and the memory that training takes.

Run `python benchmarks/device/rollout.py --csv FILE`. A frame is 24 steps with their masks drawn on
the GPU, computing only: no file is read and no array leaves the GPU. Training is a rollout of 64
steps and its gradient, with the memory it takes at most.
"""

import argparse
import csv
from datetime import datetime, timezone
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch
from torch import Tensor

import vnca
from vnca.bench.contenders import DTYPES, PROBABILITY, Case, Place
from vnca.core import Index
from vnca.engine import Compute, open_session
from vnca.engine.automaton import Automaton, Weights, stencil

COLUMNS = ("date", "device", "torch", "vnca", "what", "dtype", "grid", "occupancy", "ms", "peak_mb")


class Rollout:
    """A case on the GPU."""

    def __init__(self, case: Case, dtype: torch.dtype) -> None:
        place = Place("cuda", dtype)
        # So small that no state grows beyond what float16 holds.
        weights = (0.01 * torch.from_numpy(array).cuda() for array in case.weights)
        self.weights = Weights(*(weight.requires_grad_() for weight in weights))
        self._session = open_session(
            Automaton(self.weights, stencil(), PROBABILITY, seed=0),
            case.domain,
            place.tensor(case.priors),
            Compute("triton", "cuda"),
            differentiable=True,
        )
        self.state = place.tensor(case.state)
        self.gradient = place.tensor(case.gradient)

    def after(self, steps: int) -> Tensor:
        """The state then."""
        return self._session.run(self.state, range(steps))

    def frame(self) -> None:
        """What painting a frame computes."""
        with torch.no_grad():
            self.after(24)

    def training(self) -> None:
        """What training computes of the automaton in an iteration."""
        torch.autograd.grad(self.after(64), self.weights, self.gradient)


def milliseconds(work: Any, repeats: int) -> tuple[float, float]:
    """The median, and the memory it takes at most beyond what was there, in MB."""
    work()
    torch.cuda.synchronize()
    before = torch.cuda.memory_allocated()
    torch.cuda.reset_peak_memory_stats()
    times = []
    for _ in range(repeats):
        begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        begin.record()
        work()
        end.record()
        end.synchronize()
        times.append(begin.elapsed_time(end))
    return median(times), (torch.cuda.max_memory_allocated() - before) / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--csv", type=Path, metavar="FILE", required=True)
    options = parser.parse_args()
    run = {
        "date": datetime.now(timezone.utc).date().isoformat(),
        "device": torch.cuda.get_device_name(),
        "torch": torch.__version__,
        "vnca": vnca.__version__,
    }
    cases: list[tuple[str, Index, float, tuple[str, ...]]] = [
        ("frame", (200, 300, 200), 0.15, ("float16", "tf32")),
        ("training", (128, 128, 128), 0.15, ("float16", "tf32", "float32")),
        ("training", (128, 128, 128), 1.0, ("float16", "tf32", "float32")),
    ]
    rows = []
    for what, grid, occupancy, dtypes in cases:
        case = Case.draw(grid, 128, occupancy)
        for dtype in dtypes:
            torch.set_float32_matmul_precision("high" if dtype == "tf32" else "highest")
            rollout = Rollout(case, DTYPES[dtype])
            ms, peak = milliseconds(getattr(rollout, what), 10 if what == "frame" else 3)
            assert rollout.after(24).isfinite().all()
            row = {
                "what": what,
                "dtype": dtype,
                "grid": "x".join(map(str, grid)),
                "occupancy": round(len(case.domain) / float(np.prod(grid)), 4),
                "ms": round(ms, 3),
                "peak_mb": round(peak, 1),
            }
            print(row)
            rows.append({**run, **row})
    options.csv.parent.mkdir(parents=True, exist_ok=True)
    with options.csv.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
