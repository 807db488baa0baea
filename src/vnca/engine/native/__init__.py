"""The backend in C++, fused and vectorised, threaded; on the CPU."""

from functools import partial
from typing import Any

from vnca.core.typing import FloatArray
from vnca.engine.automaton import Weights
from vnca.engine.native import step as native
from vnca.engine.session import PRECISIONS, Backend, Compute, Job, Session, StepSession


class NativeBackend(Backend):
    """Runs on the CPU where installation found a compiler."""

    name = "native"
    precisions = PRECISIONS

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        if compute.device_type != "cpu":
            return f"the native kernel works on the CPU, not on {compute.device_type}"
        return native.unavailable(compute.precision)

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        options = {"threads": job.compute.threads, "precision": job.compute.precision}
        if not job.differentiable:
            update = partial(_update, **options)
            return StepSession.open(job, draw=native.changing_rows, update=update)
        from vnca.engine.native.step_autograd import changing_rows
        from vnca.engine.tensors import tensor_session

        return tensor_session(job, draw=changing_rows, update=self.update(**options))

    def update(self, *, threads: int | None = None, precision: str = "float32") -> Any:
        """See `Backend.update`."""
        from vnca.engine.native.step_autograd import update

        return partial(update, threads=threads, precision=precision)


def _update(*arrays: Any, **options: Any) -> FloatArray:
    """The step on arrays, called as that of the reference is."""
    state, rows, neighbours, conditioning, weights, stencil = arrays
    assert isinstance(weights, Weights)
    return native.forward(state, rows, neighbours, conditioning, *weights, stencil, **options)


BACKEND = NativeBackend()
