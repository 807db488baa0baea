"""One step of the automaton in plain numpy, forward only: what runs where nothing else can.

`reference.py` is the same step on tensors, with gradients and with the derivation.
"""

import numpy as np

from vnca.core.typing import FloatArray, IntArray
from vnca.engine.automaton import Weights

SLAB = 4096
"""Cells worked through at a time: their perception and hidden layer stay in cache."""


def update(
    state: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
    priors: FloatArray,
    weights: Weights,
    stencil: FloatArray,
) -> FloatArray:
    """The state `[n + 1, C]` after one step; arguments are those of the reference."""
    hidden, bias, output = weights
    result = state.copy()
    for start in range(0, len(rows), SLAB):
        slab = rows[start : start + SLAB]
        perception = np.tensordot(stencil, state[neighbours[:, slab]], axes=1)
        inputs = np.concatenate([*perception, priors[slab]], axis=1)
        result[slab] += np.maximum(inputs @ hidden.T + bias, 0) @ output.T
    return result
