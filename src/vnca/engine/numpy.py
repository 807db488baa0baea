"""The backend in plain numpy, for machines without torch and without the native core.

Forward only: what runs where nothing else can. `engine/reference/equations.py` has the same on
tensors, with gradients and the derivation.
"""

from collections.abc import Callable
from itertools import product

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.core.colour import srgb_to_linear
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
    """What is seen `[m, 4]` at points; arguments are those of `native.decoding.decode`.

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


def decode_parts(
    state: FloatArray,
    cells: IntArray,
    neighbours: IntArray,
    parts: int,
    samples: int,
    weights: DecoderWeights | None,
    most: float,
    *,
    decode: Callable[..., FloatArray] = decode,
    points_at_once: int = POINT_SLAB,
) -> tuple[FloatArray, FloatArray]:
    """What parts of cells show; arguments and result are those of `native.decoding.decode_parts`.

    Without weights that is the interpolated state. Points are shown by `decode`, about
    `points_at_once` of them.
    """
    each = (len(cells), *3 * (parts,))
    colour, change = np.empty((*each, 3), state.dtype), np.empty(each, state.dtype)
    along = parts * samples
    at_once = max(1, points_at_once // along**3)
    for start in range(0, len(cells), at_once):
        slab = slice(start, start + at_once)
        seen = decode(state, *subdivided(cells[slab], neighbours, along), weights)
        seen = seen.reshape(-1, *3 * (parts, samples), OUTPUTS)
        light = srgb_to_linear(np.clip(seen[..., :3] + 0.5, 0, 1))
        colour[slab] = light.mean((2, 4, 6))
        change[slab] = np.clip(seen[..., 3], -most, most).mean((2, 4, 6))
    return colour, change


def interpolate(state: FloatArray, rows: IntArray, fractions: FloatArray) -> FloatArray:
    """The state `[m, C]` between the cells, trilinear; arguments as of `native.decoding.decode`."""
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
        return ArrayDecode(decode, decode_parts)


BACKEND = NumpyBackend()
