"""The backend on NVIDIA GPUs."""

import importlib.util
from collections.abc import Callable
from typing import Any

from vnca.engine import Backend, Compute, Job, Session


class TritonBackend(Backend):
    """Runs on NVIDIA GPUs, and in Triton's interpreter where that is asked for."""

    name = "triton"

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        if importlib.util.find_spec("torch") is None:
            return "it needs torch; install vnca[train]"
        from vnca.engine.triton import step

        return step.unavailable(compute.device)

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        from vnca.engine.tensors import tensor_session
        from vnca.engine.triton.step_kernels import changing_rows

        return tensor_session(job, draw=changing_rows, update=self.update())

    def update(self, *, threads: int | None = None, precision: str = "float32") -> Any:
        """See `Backend.update`."""
        from vnca.engine.triton.step import update

        return update

    def decode(self, *, threads: int | None = None) -> Callable[..., Any]:
        """See `Backend.decode`."""
        from vnca.engine.triton.decode import decode

        return decode


BACKEND = TritonBackend()
