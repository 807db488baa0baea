"""The backend in plain numpy, for machines without torch and without the native core.

The step in `engine/reference/step.py` is the same on tensors, with gradients and the derivation.
"""

import numpy as np

from vnca.core.typing import FloatArray, IntArray
from vnca.engine.automaton import Weights, changing_rows
from vnca.engine.session import Backend, Compute, Job, Session, StepSession

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


class NumpyBackend(Backend):
    """Runs everywhere, forward only."""

    name = "numpy"
    has_gradients = False

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        if compute.device_type != "cpu":
            return f"numpy works on the CPU, not on {compute.device_type}"
        return None

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        return StepSession.open(job, draw=draw, update=update)


def draw(hashes: IntArray, *, seed: int, step: int, probability: float) -> IntArray:
    """Rows `[m]` of the cells that change; `hashes` `[n]` are the bits of `hash_cells` as int32."""
    bits = hashes.view(np.uint32)
    return changing_rows(bits, seed=seed, step=step, probability=probability)


BACKEND = NumpyBackend()
