"""The reference in torch: written to be read, never called by a fast path."""

import importlib.util
from collections.abc import Callable
from typing import Any

from vnca.engine import Backend, Compute, Job, Session


class ReferenceBackend(Backend):
    """Runs wherever torch does, slowly."""

    name = "reference"
    steers = True

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        if importlib.util.find_spec("torch") is None:
            return "it needs torch; install vnca[train]"
        return None

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        from vnca.engine.tensors import changing_rows, tensor_session

        return tensor_session(job, draw=changing_rows, update=self.update())

    def update(self, *, threads: int | None = None, precision: str = "float32") -> Any:
        """See `Backend.update`."""
        from vnca.engine.reference.equations import update

        return update

    def decode(self, *, threads: int | None = None) -> Callable[..., Any]:
        """See `Backend.decode`."""
        from vnca.engine.reference.equations import decode

        return decode


BACKEND = ReferenceBackend()
