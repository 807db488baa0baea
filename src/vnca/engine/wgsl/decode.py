"""Decoding of arrays in WGSL."""

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.engine.automaton import OUTPUTS, DecoderWeights
from vnca.engine.wgsl import device
from vnca.engine.wgsl.device import Buffer, bound, dispatched, pipeline, require_device, source
from vnca.engine.wgsl.parts import Rows, require_bindings
from vnca.engine.wgsl.session import quarters, widened

THREADS = 64
"""Of a group, as `points.wgsl` has it."""
STATE = 16
"""The first binding of the state."""
BYTES_OF_POINT = 32
"""The rows of eight corners."""
POINTS_AT_ONCE = 1 << 20
"""Their rows and fractions are brought to the device together: 44 MB."""


def decode(
    state: FloatArray, rows: IntArray, fractions: FloatArray, weights: DecoderWeights | None
) -> FloatArray:
    """What is seen `[m, 4]` at points; arguments are those of `native.decoding.decode`.

    Without weights that is the interpolated state.
    """
    require_device()
    units = 0 if weights is None else quarters(len(weights.first))
    planes = quarters(state.shape[1])
    cells = Rows.of(widened(state))
    require_bindings(cells.layout.parts + 4)
    reading = cells.layout.declared("state", "vec4f", STATE, width="PLANES")
    code = source("decoder", "points", planes=planes, units4=units)
    ready = pipeline(reading + code, "decode")
    layers = Buffer.empty(0) if weights is None else Buffer.of(packed_decoder(weights))
    network = bound(ready, {0: layers}, group=1)
    result = np.empty((len(fractions), OUTPUTS), np.float32)
    at_once = min(POINTS_AT_ONCE, device.binding_bytes() // BYTES_OF_POINT)
    for start in range(0, len(fractions), at_once):
        some = slice(start, start + at_once)
        count = len(fractions[some])
        seen = Buffer.empty(4 * OUTPUTS * count)
        header = np.array([count, len(state) - 1, 0, 0], np.uint32)
        around = np.ascontiguousarray(rows[:, some])
        bindings = {
            0: Buffer.of(header, uniform=True),
            1: Buffer.of(around),
            2: Buffer.of(fractions[some]),
            3: seen,
            **cells.bindings(STATE),
        }
        dispatched(ready, [bound(ready, bindings), network], -(-count // THREADS))
        result[some] = seen.read(np.float32).reshape(-1, OUTPUTS)
    return result


def packed_decoder(weights: DecoderWeights) -> FloatArray:
    """The weights behind each other, each with zeros up to whole vectors: `decoder.wgsl`."""
    units = 4 * quarters(len(weights.first))
    parts = []
    for matrix, bias in zip(weights[::2], weights[1::2], strict=True):
        rows = units if len(matrix) == len(weights.first) else OUTPUTS
        padded = np.zeros((rows, 4 * quarters(matrix.shape[1])), np.float32)
        padded[: len(matrix), : matrix.shape[1]] = matrix
        shift = np.zeros(rows, np.float32)
        shift[: len(bias)] = bias
        parts += [padded.reshape(-1), shift]
    return np.concatenate(parts)
