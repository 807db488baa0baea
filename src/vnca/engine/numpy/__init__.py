"""The backend in numpy, for machines without torch and without the native core."""

import numpy as np

from vnca.core.typing import IntArray
from vnca.engine.backend import Backend
from vnca.engine.mask import changing_rows
from vnca.engine.numpy.step import update
from vnca.engine.session import Compute, Job, Session, StepSession


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
        return StepSession.open(job, draw=_draw, update=update)


def _draw(hashes: IntArray, *, seed: int, step: int, probability: float) -> IntArray:
    bits = hashes.view(np.uint32)
    return changing_rows(bits, seed=seed, step=step, probability=probability)


BACKEND = NumpyBackend()
