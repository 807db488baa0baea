"""One step of the automaton in every backend: time, share of the machine's peaks, memory.

Masks are drawn beforehand for all of them. Work is counted the same for every backend: the matrix
products that a step or its gradient needs in the cells that change, and the bytes that it must
read or write at least. What a backend does beyond that, in cells that the mask drops or to
compute a hidden layer again, lowers its shares.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import torch

from vnca.bench import Difference, Spread, in_turns, peak_mb, require_agreement, run_facts
from vnca.bench.contenders import (
    CHANNELS,
    DTYPES,
    PASSES,
    Case,
    Contender,
    Place,
    available,
    contender,
    require,
)
from vnca.core import Index
from vnca.core.errors import OptionError
from vnca.engine import device_named, native
from vnca.engine.automaton import NEIGHBOURS
from vnca.engine.native import default_threads, multiply_adds
from vnca.rule import PRIORS

ARRAYS = ("state", "gradient of the state", "gradient of W1", "gradient of b1", "gradient of W2")
TOLERANCES = {
    "float32": (1e-5, 1e-3),
    "tf32": (1e-3, 1e-2),
    "float16": (1e-3, 1e-2),
    "bfloat16": (1e-2, 1e-1),
}
"""For the state and for gradients, against the reference in float64. Gradients are given more: a
hidden unit so near zero that rounding turns it on or off changes them by a jump."""
_TRIES = 4
"""Of the peak a repeat: it is the best of all."""
_ROUNDS = 100_000


PEAKS = {"registers": "multiply-adds in registers", "gemm": "GEMM"}
"""What a machine's peak of arithmetic may be that of."""


class Peak(NamedTuple):
    """Work that nothing on the machine does faster.

    Attributes:
        work: One call of it.
        amount: Floating-point operations, or bytes read and written.
        name: Of the work.
    """

    work: Callable[[], object]
    amount: float
    name: str

    def begin(self) -> Callable[[], object]:
        """Nothing has to be done before."""
        return self.work


def arithmetic(place: Place, threads: int) -> Peak:
    """Multiply-adds in registers, where the native kernel was built; a GEMM elsewhere.

    How fast a GEMM is depends on its library and sizes, and on the CPU varies from run to run.
    """
    precision = "bfloat16" if place.dtype == torch.bfloat16 else "float32"
    if place.device != "cpu" or native.unavailable(precision) is not None:
        return gemm(place)
    operations = multiply_adds(1, precision=precision, threads=threads)
    work = partial(multiply_adds, _ROUNDS, precision=precision, threads=threads)
    return Peak(work, operations * _ROUNDS, "registers")


def gemm(place: Place) -> Peak:
    """A product of square matrices."""
    size = 1024 if place.device == "cpu" else 8192
    left, right, product = (place.tensor(torch.rand(size, size)) for _ in range(3))
    return Peak(lambda: torch.mm(left, right, out=product), 2.0 * size**3, "gemm")


def copying(place: Place) -> Peak:
    """A copy between two arrays that no cache holds."""
    size = 1 << (27 if place.device == "cpu" else 30)
    source, target = (torch.ones(size, dtype=torch.uint8, device=place.device) for _ in range(2))
    return Peak(lambda: target.copy_(source), 2.0 * size, "copy")


@dataclass(frozen=True)
class StepConfig:
    """What is measured of one step."""

    grid: Index = (64, 64, 64)
    """Cells along x, y and z."""
    hidden: int = 128
    """Hidden units."""
    occupancy: float = 1.0
    """Share of the active cells, in a ragged column; rows say what it really is."""
    backends: tuple[str, ...] = ()
    """Of plain, compile, onnx, reference, native and triton; all that can run here unless given."""
    passes: tuple[str, ...] = ("forward", "both")
    """Of forward, backward and both, which is a forward pass and its gradient."""
    dtypes: tuple[str, ...] = ("float32",)
    """Of float32, tf32 (products may round to 10 bits; on GPUs), float16 and bfloat16."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    threads: int = default_threads()
    """Of the CPU; as many as it has cores unless given."""
    repeats: int = 5
    """How often everything is measured, in turns."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "device", device_named(self.device))
        if min(self.grid) < 1:
            raise OptionError(f"`grid` {'x'.join(map(str, self.grid))}: at least 1x1x1 is needed")
        for name in ("hidden", "threads", "repeats"):
            if getattr(self, name) < 1:
                raise OptionError(f"`{name}` {getattr(self, name)}: at least 1 is needed")
        if not 0 < self.occupancy <= 1:
            raise OptionError(f"`occupancy` {self.occupancy}: must be over 0 and at most 1")
        for name, known in (("passes", PASSES), ("dtypes", DTYPES)):
            chosen = getattr(self, name)
            if not chosen or not set(chosen) <= set(known):
                raise OptionError(f"`{name}` {','.join(chosen)}: expected of {', '.join(known)}")
        for name in {"tf32", "float16"}.intersection(self.dtypes):
            if self.device == "cpu":
                raise OptionError(f"`dtypes` {name}: is of GPUs; expected float32 or bfloat16 here")


class Entry(NamedTuple):
    """A backend that takes part.

    Attributes:
        case: What it steps, with numbers that its type can hold.
        name: Of the backend.
        contender: Ready to step.
    """

    case: Case
    name: str
    contender: Contender


class StepRun(NamedTuple):
    """What was found with numbers of one type.

    Attributes:
        dtype: The type.
        peak_of: What that is the peak of: multiply-adds in `registers`, or a `gemm`.
        peak_gflops: Peak of arithmetic, GFLOP/s.
        copy_gbs: Peak of copying, GB read and written a second.
        rows: One a backend and pass, by column.
    """

    dtype: str
    peak_of: str
    peak_gflops: float
    copy_gbs: float
    rows: list[dict[str, Any]]


def measure_steps(config: StepConfig) -> Iterator[StepRun]:
    """Measure what `prepare` found possible, one type of number after the other.

    Raises:
        OptionError: If there is no cell to measure.
        DisagreementError: If backends do not compute the same; then nothing is timed.
    """
    case = Case.draw(config.grid, config.hidden, config.occupancy)
    for dtype in config.dtypes:
        yield measure(take_part(case, config, dtype), config, dtype)


def prepare(config: StepConfig) -> dict[str, str | int]:
    """Set the number of threads, and find out before long work whether it can be done.

    Returns:
        What all rows share.

    Raises:
        BackendUnavailableError: If a backend that was named cannot run.
        OptionError: If there is none of that name, or no GPU.
    """
    for dtype in config.dtypes:
        for name in config.backends:
            require(name, dtype, config.device)
    torch.set_num_threads(config.threads)
    return run_facts(config.device, config.threads)


def take_part(case: Case, config: StepConfig, dtype: str) -> list[Entry]:
    """The backends, each held to the reference in float64.

    Raises:
        OptionError: If no cell changes.
        DisagreementError: If backends do not compute the same.
    """
    if not len(case.rows):
        raise OptionError(
            f"`grid` {'x'.join(map(str, config.grid))}: no cell of it changes; take a larger one"
        )
    _set_tf32(dtype)
    place = Place(config.device, DTYPES[dtype])
    case = case.rounded(place.dtype)
    entries = [
        Entry(case, name, contender(case, name, place, threads=config.threads))
        for name in config.backends or available(dtype, config.device)
    ]
    gradients = any(part != "forward" for part in config.passes)
    require_agreement(differences(entries, place.device, TOLERANCES[dtype], gradients=gradients))
    return entries


def differences(
    entries: Sequence[Entry], device: str, tolerances: tuple[float, float], *, gradients: bool
) -> Iterator[Difference]:
    """How far backends are from the reference in float64; this warms them up, too.

    Args:
        entries: The backends, on one case.
        device: Where the reference computes.
        tolerances: What is allowed of the state, and of gradients.
        gradients: Whether gradients are compared as well.
    """
    exactly = Place(device, torch.float64)
    exact = contender(entries[0].case, "reference", exactly, threads=1)
    right = exact.begin("both" if gradients else "forward")()
    for _, name, backend in entries:
        (state,) = backend.begin("forward")()
        both = gradients and backend.has_gradients
        to_inputs = backend.begin("both")()[1:] if both else backend.inputs
        results = backend.listed(state, *to_inputs)
        for array, got, expected in zip(ARRAYS, results, right, strict=False):
            difference = got.detach().to(expected) - expected
            error = float(torch.linalg.norm(difference) / torch.linalg.norm(expected))
            yield Difference(name, array, error, tolerances[array != ARRAYS[0]])


def measure(entries: Sequence[Entry], config: StepConfig, dtype: str) -> StepRun:
    """Time the entries in turns with the machine's peaks, then see what memory each takes."""
    _set_tf32(dtype)
    place = Place(config.device, DTYPES[dtype])
    product, copy = arithmetic(place, config.threads), copying(place)
    passes = {
        (at, part): partial(entry.contender.begin, part)
        for at, entry in enumerate(entries)
        for part in config.passes
        if part == "forward" or entry.contender.has_gradients
    }
    peaks = {(-1, f"{i}"): product.begin for i in range(_TRIES)} | {(-1, "copy"): copy.begin}
    times = in_turns({**peaks, **passes}, place.device, config.repeats)
    best = {part: min(times[-1, part]) for _, part in peaks}
    peak = product.amount / min(took for part, took in best.items() if part != "copy")
    copy_peak = copy.amount / best["copy"]
    rows = []
    for (at, part), begin in passes.items():
        case, name, _ = entries[at]
        spread, alive = Spread.of(times[at, part]), len(case.domain)
        flops = len(case.rows) * needed_flop(case.hidden)[part] / spread.median
        bytes_ = alive * needed_bytes(place.dtype.itemsize)[part] / spread.median
        rows.append(
            {
                "backend": name,
                "dtype": dtype,
                "pass": part,
                "grid": "x".join(map(str, case.domain.box.shape)),
                "hidden": case.hidden,
                "occupancy": round(case.occupancy, 4),
                "ns_per_cell_min": round(spread.least * 1e9 / alive, 4),
                "ns_per_cell": round(spread.median * 1e9 / alive, 4),
                "ns_per_cell_max": round(spread.most * 1e9 / alive, 4),
                "gflops": round(flops / 1e9, 2),
                "share_of_peak": round(flops / peak, 4),
                "share_of_copy": round(bytes_ / copy_peak, 4),
                "peak_of": product.name,
                "peak_gflops": round(peak / 1e9, 1),
                "copy_gbs": round(copy_peak / 1e9, 1),
                "peak_mb": peak_mb(begin(), place.device),
            }
        )
    return StepRun(dtype, product.name, peak / 1e9, copy_peak / 1e9, rows)


def needed_flop(hidden: int) -> dict[str, int]:
    """Of the matrix products, per changed cell; derived in `vnca/engine/README.md`."""
    forward = 2 * hidden * (6 * CHANNELS + PRIORS)
    backward = 2 * hidden * (12 * CHANNELS + PRIORS)
    return {"forward": forward, "backward": backward, "both": forward + backward}


def needed_bytes(size: int) -> dict[str, int]:
    """Read or written at least, per active cell, with numbers of `size` bytes.

    Forward: table of neighbours, priors, state, new state. Backward: the same two, state, gradient,
    new gradient. A mask drops single cells, but memory moves whole lines.
    """
    table = 4 * NEIGHBOURS
    forward = table + size * (PRIORS + 2 * CHANNELS)
    backward = table + size * (PRIORS + 3 * CHANNELS)
    return {"forward": forward, "backward": backward, "both": forward + backward}


def _set_tf32(dtype: str) -> None:
    torch.set_float32_matmul_precision("high" if dtype == "tf32" else "highest")
    torch.backends.cudnn.allow_tf32 = dtype == "tf32"
