"""What is seen between the cells of a state, and its gradients, in the native core."""

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.core.errors import ShapeError
from vnca.engine.automaton import OUTPUTS, DecoderWeights
from vnca.engine.native import checked, default_threads, extension

_OPERATION = "decoding"


def decode_instructions() -> list[str]:
    """Instruction sets that decoding can use on this machine, the default first.

    Raises:
        BackendUnavailableError: If the extension was not built.
    """
    return extension().decode_instructions()


def decode(
    state: FloatArray,
    rows: IntArray,
    fractions: FloatArray,
    weights: DecoderWeights,
    *,
    threads: int | None = None,
    out: FloatArray | None = None,
    instructions: str = "",
) -> FloatArray:
    """What is seen at points between the cells of a state, not clamped.

    Bit-equal between runs and whatever the number of threads. Other Python threads run meanwhile.

    Args:
        state: `[n + 1, C]`, C from 4 to 64; the last row is the outside, always zero.
        rows: `[8, m]` rows of the state around each point, z fastest; n for the outside.
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


def decode_parts(
    state: FloatArray,
    cells: IntArray,
    neighbours: IntArray,
    parts: int,
    samples: int,
    weights: DecoderWeights,
    most: float,
    *,
    threads: int | None = None,
    instructions: str = "",
) -> tuple[FloatArray, FloatArray]:
    """What the parts of some cells show: means over `samples`³ points in each part.

    Args:
        state: As of `decode`.
        cells: `[m]` rows of the cells.
        neighbours: `[27, n]` rows of the state around each cell; n for the outside.
        parts: Along each axis of a cell.
        samples: Points along each axis of a part, at most 8 along a cell.
        weights: As of `decode`.
        most: How far Δd counts.
        threads: As of `decode`.
        instructions: As of `decode`.

    Returns:
        Linear RGB in [0, 1] `[m, parts, parts, parts, 3]`, and Δd `[m, parts, parts, parts]`.

    Raises:
        BackendUnavailableError: See `decode`.
        ShapeError: See `decode`; or if there are more points.
    """
    each = (len(cells), *3 * (max(0, parts),))
    colour, change = np.empty((*each, 3), np.float32), np.empty(each, np.float32)
    arguments = (state, cells, neighbours, parts, samples, tuple(weights), most, colour, change)
    options = (threads or default_threads(), instructions)
    checked(_OPERATION, extension().decode_parts, *arguments, *options)
    return colour, change


def decode_backward(
    state: FloatArray,
    rows: IntArray,
    fractions: FloatArray,
    weights: DecoderWeights,
    gradient: FloatArray,
    *,
    threads: int | None = None,
    instructions: str = "",
) -> tuple[FloatArray, DecoderWeights]:
    """Gradients of the state `[n + 1, C]` and of the weights from that of `decode`'s result.

    The hidden layers are computed anew. Bit-equal between runs and whatever the number of threads.
    The gradient of the outside is zero. Arguments and errors are those of `decode`.
    """
    if not all(isinstance(array, np.ndarray) for array in (state, *weights)):
        raise ShapeError(f"{_OPERATION}: expected arrays")
    to_state = np.empty_like(state)
    to_weights = DecoderWeights(*map(np.empty_like, weights))
    arguments = (state, rows, fractions, tuple(weights), gradient, to_state, tuple(to_weights))
    options = (threads or default_threads(), instructions)
    checked(_OPERATION, extension().decode_backward, *arguments, *options)
    return to_state, to_weights


def show(
    seen: FloatArray, most: float, *, threads: int | None = None, instructions: str = ""
) -> tuple[FloatArray, FloatArray]:
    """What becomes of colours and density where so much is seen.

    Args:
        seen: `[m, 4]` as `decode` has it.
        most: How far Δd counts.
        threads: As of `decode`.
        instructions: As of `decode`.

    Returns:
        Linear RGB in [0, 1] `[m, 3]`, and 1 + Δd `[m]`.

    Raises:
        BackendUnavailableError: See `decode`.
        ShapeError: See `decode`.
    """
    colour, factor = np.empty((len(seen), 3), np.float32), np.empty(len(seen), np.float32)
    options = (threads or default_threads(), instructions)
    checked("showing", extension().show, seen, most, colour, factor, *options)
    return colour, factor


def show_backward(
    seen: FloatArray,
    most: float,
    of_colour: FloatArray,
    of_factor: FloatArray,
    *,
    threads: int | None = None,
    instructions: str = "",
) -> FloatArray:
    """The gradient of `seen` `[m, 4]` from those of what `show` gives; zero where that is clamped.

    Arguments and errors are those of `show`.
    """
    gradient = np.empty_like(seen)
    arrays = (seen, most, of_colour, of_factor, gradient)
    options = (threads or default_threads(), instructions)
    checked("showing", extension().show_backward, *arrays, *options)
    return gradient
