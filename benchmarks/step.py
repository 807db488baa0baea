"""Times for one step of the automaton in every backend, in one run.

Run `python benchmarks/step.py`. Backends take turns, so that a busy machine slows them alike.
`plain` is the step as the field writes it, kept here as the fixed baseline; it works on the whole
grid, the others on the cells that live and change. Masks are drawn beforehand for all of them.

Times are per living cell. GFLOP/s count the matrix products that a step or its gradient needs in
the cells that change, the same for every backend: what one does beyond that, in cells that the
mask drops or to compute a hidden layer again, lowers its share of the machine's peak.
"""

import argparse
import csv
import json
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

import vnca
from vdb import smoke
from vnca.automaton.domain import Domain
from vnca.errors import VncaError
from vnca.kernels.update.backend import torch_step
from vnca.kernels.update.mask import changing_rows
from vnca.kernels.update.reference import Weights
from vnca.kernels.update.stencil import FILTERS, stencil
from vnca.typing import FloatArray, Index, IntArray

CHANNELS, PRIORS, PROBABILITY = 12, 7, 0.5
BACKENDS = ("plain", "compile", "reference", "native")
PASSES = ("forward", "both")
ARRAYS = ("state", "gradient of the state", "gradient of W1", "gradient of b1", "gradient of W2")
TOLERANCES = (1e-5, *[1e-3] * 4)
"""Of ARRAYS: the norm of the difference from float64 over the norm. Gradients are given more: a
hidden unit so near zero that rounding turns it on or off changes them by a jump."""
COLUMNS: list[str] = [
    *("date", "device", "threads", "torch", "vnca"),
    *("backend", "pass", "grid", "hidden", "occupancy"),
    *("ns_per_cell_min", "ns_per_cell", "ns_per_cell_max", "gflops", "share_of_peak"),
]


@dataclass(frozen=True)
class Case:
    """One step, the same for every backend, and a gradient of its result."""

    domain: Domain
    rows: IntArray
    state: FloatArray
    priors: FloatArray
    weights: tuple[FloatArray, FloatArray, FloatArray]
    gradient: FloatArray

    @classmethod
    def draw(cls, grid: Index, hidden: int, occupancy: float) -> "Case":
        """Random values; with an occupancy under 1 only the cells of a ragged column live."""
        random = np.random.default_rng(0)

        def normal(*shape: int, scale: float = 1.0) -> FloatArray:
            return scale * random.standard_normal(shape, dtype=np.float32)

        alive = np.ones(grid, dtype=bool) if occupancy >= 1 else smoke(grid, occupancy)[1]
        domain = Domain.from_mask(alive, (0, 0, 0))
        n = len(domain)
        state = normal(n + 1, CHANNELS)
        state[-1] = 0
        inputs = FILTERS * CHANNELS + PRIORS
        return cls(
            domain,
            changing_rows(domain.hashes, seed=0, step=0, probability=PROBABILITY),
            state,
            normal(n, PRIORS),
            (
                normal(hidden, inputs, scale=0.1),
                normal(hidden, scale=0.1),
                normal(CHANNELS, hidden, scale=0.1),
            ),
            normal(n + 1, CHANNELS),
        )


class Backend(NamedTuple):
    """A step in a backend's own layout.

    Attributes:
        step: The new state from the inputs.
        inputs: State, W1, b1 and W2.
        gradient: Of the new state.
        listed: Brings a new state and gradients of the inputs into the layout of a `Case`.
    """

    step: Callable[..., Tensor]
    inputs: tuple[Tensor, ...]
    gradient: Tensor
    listed: Callable[..., tuple[Tensor, ...]]

    def forward(self) -> Tensor:
        """The new state, as when a style is applied."""
        with torch.no_grad():
            return self.step(*self.inputs)

    def both(self) -> tuple[Tensor, ...]:
        """The new state and the gradients of all inputs, as in training."""
        result = self.step(*self.inputs)
        return result, *torch.autograd.grad(result, self.inputs, self.gradient)


def plain(case: Case, *, compiled: bool = False) -> Backend:
    """The step as the field writes it, on a dense grid `[1, C, x, y, z]`."""
    domain = case.domain

    def dense(values: FloatArray) -> Tensor:
        grid = torch.from_numpy(domain.scatter(values[: len(domain)], domain.box))
        return grid.permute(3, 0, 1, 2)[None].contiguous()

    def listed_state(grid: Tensor) -> Tensor:
        cells = domain.gather(grid[0].permute(1, 2, 3, 0).numpy(force=True), domain.box.lower)
        return functional.pad(torch.from_numpy(cells), (0, 0, 0, 1))

    changing = np.zeros((len(domain), 1), dtype=np.float32)
    changing[case.rows] = 1
    mask, priors = dense(changing), dense(case.priors)
    filters = torch.from_numpy(stencil())[1:].view(FILTERS - 1, 1, 3, 3, 3)
    filters = filters.repeat(CHANNELS, 1, 1, 1, 1)
    # A depthwise convolution puts out all filters of a channel together, a rule all channels of a
    # filter: W1 is put in order once, beforehand.
    order = torch.arange(FILTERS * CHANNELS + PRIORS)
    filtered = slice(CHANNELS, FILTERS * CHANNELS)
    order[filtered] = order[filtered].view(FILTERS - 1, CHANNELS).t().flatten()

    def step(grid: Tensor, first: Tensor, bias: Tensor, second: Tensor) -> Tensor:
        padded = functional.pad(grid, (1,) * 6, mode="replicate")
        perceived = functional.conv3d(padded, filters, groups=CHANNELS)
        z = torch.cat([grid, perceived, priors], dim=1)
        hidden = torch.relu(functional.conv3d(z, first, bias))
        return grid + mask * functional.conv3d(hidden, second)

    def listed(
        grid: Tensor, to_grid: Tensor, to_first: Tensor, to_bias: Tensor, to_second: Tensor
    ) -> tuple[Tensor, ...]:
        to_hidden, to_output = to_first.flatten(1)[:, order.argsort()], to_second.flatten(1)
        return listed_state(grid), listed_state(to_grid), to_hidden, to_bias, to_output

    hidden, bias, output = map(torch.from_numpy, case.weights)
    first, second = (
        hidden[:, order].view(*hidden.shape, 1, 1, 1),
        output.view(*output.shape, 1, 1, 1),
    )
    inputs = tuple(
        t.requires_grad_() for t in (dense(case.state), first, bias.clone(), second.clone())
    )
    return Backend(torch.compile(step) if compiled else step, inputs, dense(case.gradient), listed)


def packaged(case: Case, name: str, *, threads: int, dtype: torch.dtype = torch.float32) -> Backend:
    """A backend of vnca, on the list of living cells."""
    update = torch_step(name, threads=threads)

    def tensor(array: FloatArray) -> Tensor:
        return torch.tensor(array, dtype=dtype)

    rows, neighbours = torch.from_numpy(case.rows), torch.from_numpy(case.domain.neighbours)
    priors, filters = tensor(case.priors), tensor(stencil())

    def step(state: Tensor, *weights: Tensor) -> Tensor:
        return update(state, rows, neighbours, priors, Weights(*weights), filters)

    inputs = tuple(tensor(array).requires_grad_() for array in (case.state, *case.weights))
    return Backend(step, inputs, tensor(case.gradient), lambda *results: results)


def prepared(case: Case, name: str, threads: int) -> Backend:
    if name in ("plain", "compile"):
        return plain(case, compiled=name == "compile")
    return packaged(case, name, threads=threads)


def disagreements(case: Case, backends: dict[str, Backend]) -> list[str]:
    """What differs from the reference in float64, one line each; also warms everything up."""
    reference = packaged(case, "reference", threads=1, dtype=torch.float64)
    exact = [array.detach() for array in reference.both()]
    found = []
    for name, backend in backends.items():
        results = backend.both()
        alone = backend.listed(backend.forward(), *results[1:])[0]
        arrays = [("state without gradients", alone, exact[0], TOLERANCES[0])]
        arrays += zip(ARRAYS, backend.listed(*results), exact, TOLERANCES, strict=True)
        for array, got, expected, tolerance in arrays:
            error = float(torch.linalg.norm(got.detach() - expected) / torch.linalg.norm(expected))
            if not error <= tolerance:
                found.append(f"{name}: {array} is off by {error:.1e} (allowed: {tolerance:.0e})")
    return found


def seconds(work: Callable[[], object]) -> float:
    time.sleep(0.05)  # torch's threads spin for a while after their work, in the way of others
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure(
    backends: dict[str, Backend], repeats: int
) -> tuple[float, dict[tuple[str, str], list[float]]]:
    """The best GEMM in FLOP/s, and the seconds each backend took for each pass, in turns."""
    size = 1024
    left, right, product = (torch.rand(size, size) for _ in range(3))
    peak, times = 0.0, {(name, part): [] for name in backends for part in PASSES}
    for _ in range(repeats):
        for _ in range(4):
            peak = max(peak, 2 * size**3 / seconds(lambda: torch.mm(left, right, out=product)))
        for (name, part), taken in times.items():
            taken.append(seconds(getattr(backends[name], part)))
    return peak, times


def needed_flop(hidden: int) -> dict[str, int]:
    """Of the matrix products, per changed cell; derived in `vnca/kernels/update/README.md`."""
    forward = 2 * hidden * (6 * CHANNELS + PRIORS)
    backward = 2 * hidden * (12 * CHANNELS + PRIORS)
    return {"forward": forward, "both": forward + backward}


def device() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def shape(text: str) -> Index:
    x, y, z = map(int, text.split("x"))
    if min(x, y, z) < 1:
        raise ValueError
    return x, y, z


def positive(text: str) -> int:
    if int(text) < 1:
        raise ValueError
    return int(text)


def fraction(text: str) -> float:
    if not 0 < float(text) <= 1:
        raise ValueError
    return float(text)


def names(text: str) -> list[str]:
    chosen = text.split(",")
    if unknown := set(chosen) - set(BACKENDS):
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}: not among {', '.join(BACKENDS)}")
    return chosen


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grid", type=shape, default="64x64x64", metavar="XxYxZ")
    parser.add_argument("--hidden", type=positive, default=128)
    parser.add_argument("--occupancy", type=fraction, default=1.0, help="share of cells that live")
    parser.add_argument(
        "--backends", type=names, default="plain,reference,native", help=", ".join(BACKENDS)
    )
    parser.add_argument("--threads", type=positive, default=2)
    parser.add_argument("--repeats", type=positive, default=5)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="append the rows to this")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)

    case = Case.draw(options.grid, options.hidden, options.occupancy)
    try:
        backends = {name: prepared(case, name, options.threads) for name in options.backends}
        found = disagreements(case, backends)
    except VncaError as error:
        parser.error(str(error))
    if found:
        raise SystemExit("\n".join([*found, "nothing was timed: the backends disagree"]))
    peak, times = measure(backends, options.repeats)

    alive, changing = len(case.domain), len(case.rows)
    run = {
        "date": datetime.now(timezone.utc).date().isoformat(),
        "device": device(),
        "threads": options.threads,
        "torch": torch.__version__,
        "vnca": vnca.__version__,
        "gemm_gflops": round(peak / 1e9, 1),
    }
    rows: list[dict[str, Any]] = []
    for (name, part), taken in times.items():
        rate = changing * needed_flop(options.hidden)[part] / median(taken)
        rows.append(
            {
                "backend": name,
                "dtype": "float32",
                "pass": part,
                "grid": "x".join(map(str, options.grid)),
                "hidden": options.hidden,
                "occupancy": round(alive / float(np.prod(options.grid)), 4),
                "ns_per_cell_min": round(min(taken) * 1e9 / alive, 2),
                "ns_per_cell": round(median(taken) * 1e9 / alive, 2),
                "ns_per_cell_max": round(max(taken) * 1e9 / alive, 2),
                "gflops": round(rate / 1e9, 2),
                "share_of_peak": round(rate / peak, 4),
            }
        )

    print(f"{run['device']}, {options.threads} threads, torch {run['torch']}, vnca {run['vnca']}")
    print(
        f"{rows[0]['grid']} cells, {alive} alive, {changing} of them change; {CHANNELS} channels, "
        f"hidden {options.hidden}, float32; GEMM peak {run['gemm_gflops']} GFLOP/s"
    )
    print(
        f"all agree with the reference in float64: states to {TOLERANCES[0]:.0e}, "
        f"gradients to {TOLERANCES[1]:.0e} of their norm"
    )
    print("backend   pass        ns a cell (min to max)         GFLOP/s   of peak   against plain")
    for row in rows:
        baseline = times.get(("plain", row["pass"]))
        spread = f"({row['ns_per_cell_min']:.1f} to {row['ns_per_cell_max']:.1f})"
        gain = ""
        if baseline is not None:
            gain = f"{median(baseline) / median(times[row['backend'], row['pass']]):.1f}×"
        print(
            f"{row['backend']:<9} {row['pass']:<8} {row['ns_per_cell']:>9.1f} {spread:<22}"
            f"{row['gflops']:>7.1f}   {row['share_of_peak']:>7.1%}   {gain:>13}"
        )

    for path in filter(None, (options.json, options.csv)):
        path.parent.mkdir(parents=True, exist_ok=True)
    if options.json is not None:
        options.json.write_text(json.dumps({**run, "rows": rows}, indent=2) + "\n")
    if options.csv is not None:
        begun = options.csv.exists()
        with options.csv.open("a", newline="") as file:
            table = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
            if not begun:
                table.writeheader()
            table.writerows({**run, **row} for row in rows)


if __name__ == "__main__":
    main()
