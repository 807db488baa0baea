"""Decoding a state at points on the CPU, fused and vectorised; numpy in and out, float32.

The work is done by the extension of the native step (`vnca.kernels.update.native`): where one is
there, so is the other.
"""

import numpy as np

from vnca.errors import ShapeError
from vnca.kernels.decode.weights import OUTPUTS, Weights
from vnca.kernels.update.native import checked, default_threads, extension
from vnca.typing import FloatArray, IntArray

_OPERATION = "decoding"


def instructions() -> list[str]:
    """Instruction sets that decoding can use on this machine, the default first.

    Raises:
        BackendUnavailableError: If the extension was not built.
    """
    return extension().decode_instructions()


def decode(
    state: FloatArray,
    rows: IntArray,
    fractions: FloatArray,
    weights: Weights,
    *,
    threads: int | None = None,
    out: FloatArray | None = None,
    instructions: str = "",
) -> FloatArray:
    """What is seen at points between the cells of a state, not clamped.

    Bit-equal between runs and whatever the number of threads. Other Python threads run meanwhile.

    Args:
        state: `[n + 1, C]`, C from 4 to 64; the last row is the outside, always zero.
        rows: `[8, m]` rows of the state around each point, z fastest; n where nothing lives.
        fractions: `[m, 3]` of the way from the first of these cells to the last, 0 to 1.
        weights: Of the network, with layers of at most 128 units.
        threads: How many to use; by default one for each core.
        out: `[m, 4]` to write to; by default a new array.
        instructions: One of `instructions()`; by default the first.

    Returns:
        `[m, 4]`: colour as sRGB − ½, and Δd.

    Raises:
        BackendUnavailableError: If the extension was not built.
        ShapeError: If arrays are not contiguous, of other shapes or types than above, or hold rows
            out of range.
    """
    if out is None:
        out = np.empty((len(fractions), OUTPUTS), np.float32)
    arguments = (state, rows, fractions, tuple(weights), out)
    options = (threads or default_threads(), instructions)
    checked(_OPERATION, extension().decode_forward, *arguments, *options)
    return out


def decode_cells(
    state: FloatArray,
    cells: IntArray,
    neighbours: IntArray,
    factor: int,
    weights: Weights,
    *,
    threads: int | None = None,
    instructions: str = "",
) -> FloatArray:
    """What is seen at the centres of the `factor`³ parts of each of some cells, not clamped.

    Args:
        state: `[n + 1, C]`, C from 4 to 64; the last row is the outside, always zero.
        cells: `[m]` rows of the cells.
        neighbours: `[27, n]` rows of the state around each cell; n where nothing lives.
        factor: Parts along each axis of a cell, at most 8.
        weights: Of the network, with layers of at most 128 units.
        threads: How many to use; by default one for each core.
        instructions: One of `instructions()`; by default the first.

    Returns:
        `[m, factor, factor, factor, 4]`: colour as sRGB − ½, and Δd.

    Raises:
        BackendUnavailableError: If the extension was not built.
        ShapeError: If arrays are not contiguous, of other shapes or types than above, or hold rows
            out of range, or the factor is not from 1 to 8.
    """
    parts = 3 * (max(0, factor),)
    out = np.empty((len(cells), *parts, OUTPUTS), np.float32)
    arguments = (state, cells, neighbours, factor, tuple(weights), out)
    options = (threads or default_threads(), instructions)
    checked(_OPERATION, extension().decode_subdivided, *arguments, *options)
    return out


def backward(
    state: FloatArray,
    rows: IntArray,
    fractions: FloatArray,
    weights: Weights,
    gradient: FloatArray,
    *,
    threads: int | None = None,
    instructions: str = "",
) -> tuple[FloatArray, Weights]:
    """Gradients of the state `[n + 1, C]` and of the weights from that of `decode`'s result.

    The hidden layers are computed anew. Bit-equal between runs and whatever the number of threads.
    The gradient of the outside is zero. Arguments and errors are those of `decode`.
    """
    if not all(isinstance(array, np.ndarray) for array in (state, *weights)):
        raise ShapeError(f"{_OPERATION}: expected arrays")
    to_state = np.empty_like(state)
    to_weights = Weights(*map(np.empty_like, weights))
    arguments = (state, rows, fractions, tuple(weights), gradient, to_state, tuple(to_weights))
    options = (threads or default_threads(), instructions)
    checked(_OPERATION, extension().decode_backward, *arguments, *options)
    return to_state, to_weights
