"""The backend in C++: steps and decoding on the CPU, fused, vectorised and threaded.

Functions take and give numpy arrays of float32. The work is done by a small C++ extension (folder
`cpp`), which installation leaves out where it finds no compiler. It picks the widest instructions
that the machine has when it is called. Asked for, a step rounds what its matrix products multiply
to bfloat16, for twice their speed; everything else, also their sums, stays float32. The README of
the folder above says how large the error is.
"""

import os
from collections.abc import Callable
from functools import partial
from typing import Any, ParamSpec, TypeVar

import numpy as np

from vnca.core import AnyArray, FloatArray, IntArray
from vnca.core.errors import BackendUnavailableError, OptionError, ShapeError
from vnca.engine import PRECISIONS, ArrayDecode, Backend, Compute, Job, Session
from vnca.engine.automaton import mask_key, mask_threshold

try:
    import vnca.engine.native._native as _native  # pyright: ignore[reportMissingModuleSource]
except ImportError as error:
    _native: Any = None
    _reason = str(error)

P = ParamSpec("P")
T = TypeVar("T")


def unavailable(precision: str = "float32") -> str | None:
    """Why the native kernel cannot run here, or nothing if it can.

    Raises:
        OptionError: If there is no precision of that name.
    """
    if precision not in PRECISIONS:
        raise OptionError(f"precision: expected {' or '.join(PRECISIONS)}, got {precision}")
    if _native is None:
        return (
            f"its extension was not built, or does not load ({_reason}); "
            "reinstall with GCC or Clang"
        )
    if not _native.instructions(precision == "bfloat16"):
        return (
            "bfloat16 takes a processor with AVX512_BF16, and a compiler that knows it; "
            "use precision float32"
        )
    return None


def instructions(precision: str = "float32") -> list[str]:
    """Instruction sets that the kernel can use on this machine, the default first.

    Raises:
        BackendUnavailableError: If there is none, or the extension was not built.
        OptionError: If there is no precision of that name.
    """
    return extension(precision).instructions(precision == "bfloat16")


def default_threads() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def changing_rows(hashes: IntArray, *, seed: int, step: int, probability: float) -> IntArray:
    """Rows `[m]` of the cells that change, as `vnca.engine.automaton.changing_rows` draws them.

    Args:
        hashes: `[n]`, the bits of `hash_cells` as int32.
        seed: Any integer; its low 32 bits count.
        step: Steps since the state was seeded.
        probability: Chance of a cell to change, in (0, 1].

    Raises:
        BackendUnavailableError: If the extension was not built.
        ShapeError: If the hashes are not int32 and contiguous.
    """
    rows = np.empty(len(hashes), dtype=np.int32)
    if probability >= 1:
        rows[:] = np.arange(len(hashes))
        return rows
    drawn = (hashes, int(mask_key(seed, step)), int(mask_threshold(probability)), rows)
    count = checked("update mask", extension().changing_rows, *drawn)
    return rows[:count]


def forward(
    state: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
    priors: FloatArray,
    hidden: FloatArray,
    bias: FloatArray,
    output: FloatArray,
    stencil: FloatArray,
    steering: FloatArray | None = None,
    *,
    threads: int | None = None,
    out: FloatArray | None = None,
    precision: str = "float32",
    instructions: str = "",
) -> FloatArray:
    """The state after one step: s' = s + W2 relu(W1 [z ‖ priors] + b1) on `rows`, s elsewhere.

    Bit-equal between runs and whatever the number of threads. Other Python threads run meanwhile.

    Args:
        state: `[n + 1, C]`, C at most 64; the last row is the outside, always zero.
        rows: `[m]` cells that change in this step, ascending.
        neighbours: `[27, n]` rows of the state around each cell; n for the outside.
        priors: `[n, P]`, P at most 16.
        hidden: W1 `[H, 5C + P]`, H at most 512.
        bias: b1 `[H]`.
        output: W2 `[C, H]`.
        stencil: `[5, 27]` from `vnca.engine.automaton`, with any divisors; one of all three Sobel
            filters where cells are steered.
        steering: `[n, 3, 3]` matrices F: perceived gradients are multiplied by F, the Laplacian by
            |F|² / 3. Without them nothing is.
        threads: How many to use; by default one for each core.
        out: `[n + 1, C]` to write to; by default a new array.
        precision: What the factors of W1 [z ‖ priors] and W2 relu(…) are rounded to.
        instructions: One of `instructions(precision)`; by default the first.

    Returns:
        `[n + 1, C]`.

    Raises:
        BackendUnavailableError: If the extension was not built, or this machine has no bfloat16.
        OptionError: If there is no precision of that name.
        ShapeError: If arrays are not contiguous, of other shapes or types than above, or hold
            indices out of range.
    """
    if out is None:
        out = np.empty_like(state)
    arguments = (state, rows, neighbours, priors, hidden, bias, output, stencil, steering, out)
    options = (threads or default_threads(), precision == "bfloat16", instructions)
    checked("update step", extension(precision).forward, *arguments, *options)
    return out


def backward(
    state: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
    priors: FloatArray,
    hidden: FloatArray,
    bias: FloatArray,
    output: FloatArray,
    stencil: FloatArray,
    gradient: FloatArray,
    steering: FloatArray | None = None,
    *,
    threads: int | None = None,
    precision: str = "float32",
    instructions: str = "",
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Gradients of the state `[n + 1, C]`, W1, b1 and W2 from the gradient of `forward`'s result.

    The hidden layer is computed anew. With `precision` bfloat16 the factors of all products are
    rounded, and gradients are those of the step as it is then computed. Bit-equal between runs and
    whatever the number of threads. The gradient of the outside is zero. Arguments and errors are
    those of `forward`.
    """
    results = tuple(np.empty_like(array) for array in (state, hidden, bias, output))
    fixed = (rows, neighbours, priors, hidden, bias, output, stencil, steering)
    arguments = (state, *fixed, gradient)
    options = (threads or default_threads(), precision == "bfloat16", instructions)
    checked("update step", extension(precision).backward, *arguments, *results, *options)
    to_state, to_hidden, to_bias, to_output = results
    return to_state, to_hidden, to_bias, to_output


def extension(precision: str = "float32") -> Any:
    """The module of the native kernels.

    Raises:
        BackendUnavailableError: If it was not built, or this machine has no such precision.
        OptionError: If there is no precision of that name.
    """
    reason = unavailable(precision)
    if reason is not None:
        raise BackendUnavailableError(f"the native kernel cannot run: {reason}")
    return _native


def checked(operation: str, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """The result of a native function.

    Raises:
        ShapeError: Naming the operation and the array, if it refuses one.
    """
    try:
        return function(*args, **kwargs)
    except ValueError as error:
        raise ShapeError(f"{operation}: {error}") from None
    except TypeError:
        raise ShapeError(
            f"{operation}: expected arrays of float32 or int32 in this machine's byte order, those "
            "to be written to writable, and at most 2³¹ threads"
        ) from None


def fill(values: FloatArray, known: AnyArray, cells: AnyArray, beside: AnyArray) -> None:
    """Give cells the mean of those of their six neighbours that are known.

    Args:
        values: `[512 (m + 1), 3]` in m bricks of 8³, laid out flat, and in one that is not there.
        known: `[512 (m + 1)]`, which of them are.
        cells: `[k]` places of cells that are not and have a neighbour that is, int64, each once.
        beside: `[6, m]` first places of the bricks beside each, int64, by `core.marks.WAYS`.

    Raises:
        BackendUnavailableError: If the extension was not built.
        ShapeError: If arrays are of other shapes or types, or hold places out of range.
    """
    arrays = (values, known.view(np.uint8), cells, beside)
    checked("continuing values", extension().fill, *arrays, default_threads())


def multiply_adds(
    rounds: int,
    *,
    precision: str = "float32",
    threads: int | None = None,
    instructions: str = "",
) -> float:
    """Multiply-adds of numbers that stay in registers: what a step could do at most.

    As many times a few as there are rounds, in each thread; the rest is as of `forward`.

    Returns:
        How many operations were done, two for each.
    """
    how = (threads or default_threads(), precision == "bfloat16", instructions)
    return extension(precision).multiply_adds(rounds, *how)


class NativeBackend(Backend):
    """Runs on the CPU where installation found a compiler."""

    name = "native"
    precisions = PRECISIONS
    steers = True

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        if compute.device_type != "cpu":
            return f"the native kernel works on the CPU, not on {compute.device_type}"
        return unavailable(compute.precision)

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        if not job.differentiable:
            from vnca.engine.native.bricks import BrickSession

            return BrickSession.open(job)
        options = {"threads": job.compute.threads, "precision": job.compute.precision}
        from vnca.engine.native.autograd import changing_tensor_rows
        from vnca.engine.tensors import tensor_session

        return tensor_session(job, draw=changing_tensor_rows, update=self.update(**options))

    def update(self, *, threads: int | None = None, precision: str = "float32") -> Any:
        """See `Backend.update`."""
        from vnca.engine.native.autograd import update

        return partial(update, threads=threads, precision=precision)

    def decode(self, *, threads: int | None = None) -> Callable[..., Any]:
        """See `Backend.decode`."""
        from vnca.engine.native.autograd import decode

        return partial(decode, threads=threads)

    def array_decode(self, *, threads: int | None = None) -> ArrayDecode:
        """See `Backend.array_decode`."""
        from vnca.engine.native.decoding import decode, decode_parts

        return ArrayDecode(partial(decode, threads=threads), partial(decode_parts, threads=threads))


BACKEND = NativeBackend()
