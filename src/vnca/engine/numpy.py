"""The backend in plain numpy, for machines without torch and without the native core.

Forward only: what runs where nothing else can. `engine/reference/equations.py` has the same on
tensors, with gradients and the derivation.
"""

from itertools import product

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.engine import ArrayDecode, Backend, Compute, Job, Session, StepSession
from vnca.engine.automaton import OUTPUTS, DecoderWeights, Weights, changing_rows
from vnca.engine.domain import subdivided

SLAB = 4096
"""Cells worked through at a time: their perception and hidden layer stay in cache."""
POINT_SLAB = 4096
"""Points worked through at a time: their hidden layers stay in cache."""


def update(
    state: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
    priors: FloatArray,
    weights: Weights,
    stencil: FloatArray,
    steering: FloatArray | None = None,
) -> FloatArray:
    """The state `[n + 1, C]` after one step; arguments are those of the reference."""
    hidden, bias, output = weights
    result = state.copy()
    for start in range(0, len(rows), SLAB):
        slab = rows[start : start + SLAB]
        perception = np.tensordot(stencil, state[neighbours[:, slab]], axes=1)
        if steering is not None:
            turn = steering[slab]
            perception[1:4] = np.einsum("nij,jnc->inc", turn, perception[1:4])
            perception[4] *= np.square(turn).sum((1, 2))[:, None] / 3
        inputs = np.concatenate([*perception, priors[slab]], axis=1)
        result[slab] += np.maximum(inputs @ hidden.T + bias, 0) @ output.T
    return result


def draw(hashes: IntArray, *, seed: int, step: int, probability: float) -> IntArray:
    """Rows `[m]` of the cells that change; `hashes` `[n]` are the bits of `hash_cells` as int32."""
    bits = hashes.view(np.uint32)
    return changing_rows(bits, seed=seed, step=step, probability=probability)


def decode(
    state: FloatArray, rows: IntArray, fractions: FloatArray, weights: DecoderWeights | None
) -> FloatArray:
    """What is seen `[m, 4]` at points; arguments are those of `native.decode`.

    Without weights that is the interpolated state.
    """
    if weights is None:
        state = state[:, :OUTPUTS]
    result = np.empty((len(fractions), OUTPUTS), dtype=state.dtype)
    for start in range(0, len(fractions), POINT_SLAB):
        slab = slice(start, start + POINT_SLAB)
        between = interpolate(state, rows[:, slab], fractions[slab])
        result[slab] = between if weights is None else _decoded(between, weights)
    return result


def decode_cells(
    state: FloatArray,
    cells: IntArray,
    neighbours: IntArray,
    factor: int,
    weights: DecoderWeights | None,
) -> FloatArray:
    """What is seen `[m, factor, factor, factor, 4]`; arguments are those of `native.decode_cells`.

    Without weights that is the interpolated state.
    """
    result = np.empty((len(cells), *3 * (factor,), OUTPUTS), dtype=state.dtype)
    at_once = max(1, POINT_SLAB // factor**3)
    for start in range(0, len(cells), at_once):
        slab = slice(start, start + at_once)
        rows, fractions = subdivided(cells[slab], neighbours, factor)
        result[slab] = decode(state, rows, fractions, weights).reshape(result[slab].shape)
    return result


def interpolate(state: FloatArray, rows: IntArray, fractions: FloatArray) -> FloatArray:
    """The state `[m, C]` between the cells, trilinear; arguments are those of `native.decode`."""
    total = np.zeros((len(fractions), state.shape[1]), dtype=state.dtype)
    for corner, around in zip(product((0, 1), repeat=3), rows, strict=True):
        share = np.where(corner, fractions, 1 - fractions).prod(axis=1, keepdims=True)
        total += share * state[around]
    return total


def _decoded(state: FloatArray, weights: DecoderWeights) -> FloatArray:
    hidden = np.sin(state @ weights.first.T + weights.first_bias)
    hidden = np.sin(hidden @ weights.second.T + weights.second_bias)
    hidden = np.sin(hidden @ weights.third.T + weights.third_bias)
    return state[:, :OUTPUTS] + hidden @ weights.output.T + weights.output_bias


class NumpyBackend(Backend):
    """Runs everywhere, forward only."""

    name = "numpy"
    has_gradients = False
    steers = True

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        if compute.device_type != "cpu":
            return f"numpy works on the CPU, not on {compute.device_type}"
        return None

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        return StepSession.open(job, draw=draw, update=update)

    def array_decode(self, *, threads: int | None = None) -> ArrayDecode:
        """See `Backend.array_decode`."""
        return ArrayDecode(decode, decode_cells)


BACKEND = NumpyBackend()
