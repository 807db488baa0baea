"""Decoding a state at points in plain numpy, forward only: what runs where nothing else can.

`reference.py` is the same on tensors, with gradients and with the derivation.
"""

from itertools import product

import numpy as np

from vnca.core.typing import FloatArray, IntArray
from vnca.engine.decode_weights import OUTPUTS, Weights
from vnca.engine.domain import subdivided

SLAB = 4096
"""Points worked through at a time: their hidden layers stay in cache."""


def decode(
    state: FloatArray, rows: IntArray, fractions: FloatArray, weights: Weights | None
) -> FloatArray:
    """What is seen `[m, 4]` at points; arguments are those of `native.decode`.

    Without weights that is the interpolated state.
    """
    if weights is None:
        state = state[:, :OUTPUTS]
    result = np.empty((len(fractions), OUTPUTS), dtype=state.dtype)
    for start in range(0, len(fractions), SLAB):
        slab = slice(start, start + SLAB)
        between = interpolate(state, rows[:, slab], fractions[slab])
        result[slab] = between if weights is None else _network(between, weights)
    return result


def decode_cells(
    state: FloatArray, cells: IntArray, neighbours: IntArray, factor: int, weights: Weights | None
) -> FloatArray:
    """What is seen `[m, factor, factor, factor, 4]`; arguments are those of `native.decode_cells`.

    Without weights that is the interpolated state.
    """
    result = np.empty((len(cells), *3 * (factor,), OUTPUTS), dtype=state.dtype)
    at_once = max(1, SLAB // factor**3)
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


def _network(state: FloatArray, weights: Weights) -> FloatArray:
    hidden = np.sin(state @ weights.first.T + weights.first_bias)
    hidden = np.sin(hidden @ weights.second.T + weights.second_bias)
    hidden = np.sin(hidden @ weights.third.T + weights.third_bias)
    return state[:, :OUTPUTS] + hidden @ weights.output.T + weights.output_bias
