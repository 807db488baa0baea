"""Times for one step of the automaton in every backend, in one run.

Run `python benchmarks/step.py`. Backends take turns, so that a busy machine slows them alike.
`plain` is the step as the field writes it, kept here as the fixed baseline; it works on the whole
grid, the others on the cells that live and change. Masks are drawn beforehand for all of them.

Times are per living cell. GFLOP/s count the matrix products that a step or its gradient needs in
the cells that change, the same for every backend: what one does beyond that, in cells that the
mask drops or to compute a hidden layer again, lowers its share of the machine's peak.

On a GPU (`--device cuda`) a time is that of a dozen calls in a row, divided, between two of the
GPU's own events: launching a step is hidden behind the one before, as in a rollout.
"""

import argparse
import csv
import json
import platform
import time
from collections.abc import Callable, Collection
from datetime import datetime, timezone
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

import vnca
from cases import CHANNELS, PRIORS, Case, Place
from vnca.errors import VncaError
from vnca.kernels.update.backend import torch_step
from vnca.kernels.update.reference import Weights
from vnca.kernels.update.stencil import FILTERS, stencil
from vnca.typing import FloatArray, Index

BACKENDS = ("plain", "compile", "reference", "native", "triton")
PASSES = ("forward", "both")
DTYPES = {"float32": torch.float32, "tf32": torch.float32} | {
    name: getattr(torch, name) for name in ("float16", "bfloat16")
}
"""Of states, weights and products; `tf32` is float32 whose products may round to 10 bits."""
ARRAYS = ("state", "gradient of the state", "gradient of W1", "gradient of b1", "gradient of W2")
TOLERANCES = {
    "float32": (1e-5, 1e-3),
    "tf32": (1e-3, 1e-2),
    "float16": (1e-3, 1e-2),
    "bfloat16": (1e-2, 5e-2),
}
"""For the state and for gradients: the norm of the difference from float64 over the norm.
Gradients are given more: a hidden unit so near zero that rounding turns it on or off changes them
by a jump."""
CALLS = 12
"""In a row on a GPU."""
COLUMNS: list[str] = [
    *("date", "device", "threads", "torch", "vnca"),
    *("backend", "dtype", "pass", "grid", "hidden", "occupancy"),
    *("ns_per_cell_min", "ns_per_cell", "ns_per_cell_max", "gflops", "share_of_peak", "peak_mb"),
]


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


def plain(case: Case, place: Place, *, compiled: bool = False) -> Backend:
    """The step as the field writes it, on a dense grid `[1, C, x, y, z]`."""
    domain = case.domain

    def dense(values: FloatArray) -> Tensor:
        grid = torch.from_numpy(domain.scatter(values[: len(domain)], domain.box))
        return place.tensor(grid.permute(3, 0, 1, 2)[None].contiguous())

    def listed_state(grid: Tensor) -> Tensor:
        cells = grid[0].permute(1, 2, 3, 0).float().numpy(force=True)
        return functional.pad(
            torch.from_numpy(domain.gather(cells, domain.box.lower)), (0, 0, 0, 1)
        )

    changing = np.zeros((len(domain), 1), dtype=np.float32)
    changing[case.rows] = 1
    mask, priors = dense(changing), dense(case.priors)
    filters = place.tensor(stencil())[1:].view(FILTERS - 1, 1, 3, 3, 3)
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

    hidden, bias, output = map(place.tensor, case.weights)
    first, second = (
        hidden[:, order].view(*hidden.shape, 1, 1, 1),
        output.view(*output.shape, 1, 1, 1),
    )
    inputs = tuple(t.requires_grad_() for t in (dense(case.state), first, bias, second.clone()))
    return Backend(torch.compile(step) if compiled else step, inputs, dense(case.gradient), listed)


def packaged(case: Case, name: str, place: Place, *, threads: int) -> Backend:
    """A backend of vnca, on the list of living cells."""
    update = torch_step(name, device=place.device, threads=threads)
    rows, neighbours = (
        torch.from_numpy(array).to(place.device) for array in (case.rows, case.domain.neighbours)
    )
    priors = place.tensor(case.priors)
    # The fast kernels read from it what the filters are multiples of, and want it exact.
    filters = torch.from_numpy(stencil()).to(place.device)
    if name == "reference":
        filters = filters.to(place.dtype)

    def step(state: Tensor, *weights: Tensor) -> Tensor:
        return update(state, rows, neighbours, priors, Weights(*weights), filters)

    inputs = tuple(place.tensor(array).requires_grad_() for array in (case.state, *case.weights))
    return Backend(step, inputs, place.tensor(case.gradient), lambda *results: results)


def prepared(case: Case, name: str, place: Place, threads: int) -> Backend:
    if name in ("plain", "compile"):
        return plain(case, place, compiled=name == "compile")
    return packaged(case, name, place, threads=threads)


def disagreements(
    case: Case, backends: dict[str, Backend], parts: list[str], device: str, dtype: str
) -> list[str]:
    """What differs from the reference in float64, one line each; also warms everything up."""
    reference = packaged(case, "reference", Place(device, torch.float64), threads=1)
    exact = [
        array.detach() for array in (reference.both() if "both" in parts else [reference.forward()])
    ]
    found = []
    for name, backend in backends.items():
        to_gradients = backend.both()[1:] if "both" in parts else backend.inputs
        state, *gradients = backend.listed(backend.forward(), *to_gradients)
        for array, got, expected in zip(ARRAYS, (state, *gradients), exact, strict=False):
            tolerance = TOLERANCES[dtype][array != ARRAYS[0]]
            difference = got.detach().to(expected) - expected
            error = float(torch.linalg.norm(difference) / torch.linalg.norm(expected))
            if not error <= tolerance:
                found.append(f"{name}: {array} is off by {error:.1e} (allowed: {tolerance:.0e})")
    return found


def seconds(work: Callable[[], object], device: str) -> float:
    if device == "cpu":
        time.sleep(0.05)  # torch's threads spin for a while after their work, in others' way
        start = time.perf_counter()
        work()
        return time.perf_counter() - start
    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    begin.record()
    for _ in range(CALLS):
        work()
    end.record()
    end.synchronize()
    return begin.elapsed_time(end) / 1e3 / CALLS


def measure(
    backends: dict[str, Backend], parts: list[str], place: Place, repeats: int
) -> tuple[float, dict[tuple[str, str], list[float]]]:
    """The best GEMM in FLOP/s, and the seconds each backend took for each pass, in turns."""
    size = 1024 if place.device == "cpu" else 8192
    left, right, product = (place.tensor(torch.rand(size, size)) for _ in range(3))

    def multiply() -> Tensor:
        return torch.mm(left, right, out=product)

    peak, times = 0.0, {(name, part): [] for name in backends for part in parts}
    for _ in range(repeats):
        for _ in range(4):
            peak = max(peak, 2 * size**3 / seconds(multiply, place.device))
        for (name, part), taken in times.items():
            taken.append(seconds(getattr(backends[name], part), place.device))
    return peak, times


def peak_memory(work: Callable[[], object], device: str) -> float | None:
    """Megabytes of the GPU's memory that a pass takes beyond its inputs."""
    if device == "cpu":
        return None
    torch.cuda.synchronize()
    before = torch.cuda.memory_allocated()
    torch.cuda.reset_peak_memory_stats()
    work()
    torch.cuda.synchronize()
    return round((torch.cuda.max_memory_allocated() - before) / 1e6, 1)


def needed_flop(hidden: int) -> dict[str, int]:
    """Of the matrix products, per changed cell; derived in `vnca/kernels/update/README.md`."""
    forward = 2 * hidden * (6 * CHANNELS + PRIORS)
    backward = 2 * hidden * (12 * CHANNELS + PRIORS)
    return {"forward": forward, "both": forward + backward}


def device(kind: str = "cpu") -> str:
    if kind != "cpu":
        return torch.cuda.get_device_name()
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


def among(known: Collection[str]) -> Callable[[str], list[str]]:
    def names(text: str) -> list[str]:
        chosen = text.split(",")
        if unknown := set(chosen) - set(known):
            raise argparse.ArgumentTypeError(f"{', '.join(unknown)}: not among {', '.join(known)}")
        return chosen

    return names


def arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grid", type=shape, default="64x64x64", metavar="XxYxZ")
    parser.add_argument("--hidden", type=positive, default=128)
    parser.add_argument("--occupancy", type=fraction, default=1.0, help="share of cells that live")
    parser.add_argument("--backends", type=among(BACKENDS), help=", ".join(BACKENDS))
    parser.add_argument("--passes", type=among(PASSES), default="forward,both")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--dtypes", type=among(DTYPES), default="float32", help=", ".join(DTYPES))
    parser.add_argument("--threads", type=positive, default=2)
    parser.add_argument("--repeats", type=positive, default=5)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="append the rows to this")
    return parser


def timed(
    case: Case, dtype: str, options: argparse.Namespace
) -> tuple[float, list[dict[str, Any]]]:
    """The GEMM's peak in FLOP/s, and a row for each backend and pass.

    Raises:
        SystemExit: If backends disagree.
    """
    torch.set_float32_matmul_precision("high" if dtype == "tf32" else "highest")
    torch.backends.cudnn.allow_tf32 = dtype == "tf32"
    place = Place(options.device, DTYPES[dtype])
    case = case.rounded(place.dtype)
    backends = {name: prepared(case, name, place, options.threads) for name in options.backends}
    if found := disagreements(case, backends, options.passes, options.device, dtype):
        raise SystemExit("\n".join([*found, "nothing was timed: the backends disagree"]))
    peak, times = measure(backends, options.passes, place, options.repeats)
    alive = len(case.domain)
    rows = []
    for (name, part), taken in times.items():
        rate = len(case.rows) * needed_flop(options.hidden)[part] / median(taken)
        rows.append(
            {
                "backend": name,
                "dtype": dtype,
                "pass": part,
                "grid": "x".join(map(str, options.grid)),
                "hidden": options.hidden,
                "occupancy": round(alive / float(np.prod(options.grid)), 4),
                "ns_per_cell_min": round(min(taken) * 1e9 / alive, 4),
                "ns_per_cell": round(median(taken) * 1e9 / alive, 4),
                "ns_per_cell_max": round(max(taken) * 1e9 / alive, 4),
                "gflops": round(rate / 1e9, 2),
                "share_of_peak": round(rate / peak, 4),
                "gemm_gflops": round(peak / 1e9, 1),
                "peak_mb": peak_memory(getattr(backends[name], part), options.device),
            }
        )
    return peak, rows


def show(dtype: str, peak: float, rows: list[dict[str, Any]]) -> None:
    print(
        f"{dtype}: GEMM peak {peak / 1e9:.1f} GFLOP/s; all agree with the reference in float64: "
        "states to {:.0e}, gradients to {:.0e} of their norm".format(*TOLERANCES[dtype])
    )
    print("backend   pass        ns a cell (min to max)         GFLOP/s   of peak   against plain")
    plain = {row["pass"]: row["ns_per_cell"] for row in rows if row["backend"] == "plain"}
    for row in rows:
        spread = f"({row['ns_per_cell_min']:.3g} to {row['ns_per_cell_max']:.3g})"
        gain = f"{plain[row['pass']] / row['ns_per_cell']:.1f}×" if plain else ""
        print(
            f"{row['backend']:<9} {row['pass']:<8} {row['ns_per_cell']:>9.4g} {spread:<22}"
            f"{row['gflops']:>9.1f} {row['share_of_peak']:>7.1%}   {gain:>13}"
        )


def keep(path: Path, run: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    begun = path.exists()
    with path.open("a", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
        if not begun:
            table.writeheader()
        table.writerows({**run, **row} for row in rows)


def main() -> None:
    parser = arguments()
    options = parser.parse_args()
    on_gpu = options.device == "cuda"
    if on_gpu and not torch.cuda.is_available():
        parser.error("--device cuda: torch finds no NVIDIA GPU")
    options.backends = options.backends or ["plain", "reference", "triton" if on_gpu else "native"]
    torch.set_num_threads(options.threads)
    case = Case.draw(options.grid, options.hidden, options.occupancy)
    run = {
        "date": datetime.now(timezone.utc).date().isoformat(),
        "device": device(options.device),
        "threads": options.threads,
        "torch": torch.__version__,
        "vnca": vnca.__version__,
    }
    print(f"{run['device']}, {options.threads} threads, torch {run['torch']}, vnca {run['vnca']}")
    print(
        f"{'x'.join(map(str, options.grid))} cells, {len(case.domain)} alive, {len(case.rows)} of "
        f"them change; {CHANNELS} channels, hidden {options.hidden}"
    )
    rows: list[dict[str, Any]] = []
    for dtype in options.dtypes:
        try:
            peak, more = timed(case, dtype, options)
        except VncaError as error:
            parser.error(str(error))
        show(dtype, peak, more)
        rows += more

        if options.csv is not None:
            keep(options.csv, run, more)
    if options.json is not None:
        document = {**run, "gemm_gflops": rows[0]["gemm_gflops"], "rows": rows}
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
