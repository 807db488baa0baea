"""Where an automaton is computed: what a backend is, which there are, and a session on one.

A backend is one folder beside this file, with a `BACKEND` in it, and its name in `BACKENDS` of
`session.py`. It opens sessions, which hold state, neighbours, conditioning and mask where they are
computed.
"""

import sys
from abc import ABC, abstractmethod
from functools import cache
from importlib import import_module
from typing import Any

from vnca.core.errors import BackendUnavailableError
from vnca.engine.automaton import Automaton
from vnca.engine.domain import Domain
from vnca.engine.session import Compute, Job, Session


class Backend(ABC):
    """One way to compute steps.

    Attributes:
        name: As a user asks for it.
        precisions: Those it can round the factors of its products to.
        has_gradients: Whether its sessions can be differentiable.
    """

    name: str
    precisions: tuple[str, ...] = ("float32",)
    has_gradients = True

    def unavailable(self, compute: Compute, *, differentiable: bool = False) -> str | None:
        """Why it cannot compute so here, or nothing if it can."""
        if differentiable and not self.has_gradients:
            return "it has no gradients; use reference"
        if compute.precision not in self.precisions:
            return f"only the native backend has {compute.precision}; use precision float32"
        return self.missing(compute)

    @abstractmethod
    def missing(self, compute: Compute) -> str | None:
        """What it lacks here, or nothing: a device, a compiler, a package."""

    @abstractmethod
    def session(self, job: Job) -> Session:
        """A session; only called where the backend is available."""

    def update(self, *, threads: int | None = None, precision: str = "float32") -> Any:
        """The bare differentiable step on tensors, called as that of the reference is.

        For its sessions, and for comparisons of backends.

        Raises:
            BackendUnavailableError: If the backend has none.
        """
        del threads, precision
        raise BackendUnavailableError(f"backend {self.name} has no step on tensors")


def backend_named(name: str) -> Backend:
    """A registered backend, of a name in `BACKENDS`."""
    return import_module(f"vnca.engine.{name}").BACKEND


def choose(compute: Compute, *, differentiable: bool = False) -> Backend:
    """The backend to run.

    `auto` says once on stderr what it takes if that is no fast one, or if it computes on a GPU.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here, or not so.
    """
    if compute.backend != "auto":
        backend = backend_named(compute.backend)
        reason = backend.unavailable(compute, differentiable=differentiable)
        if reason is not None:
            raise BackendUnavailableError(f"backend {backend.name} cannot run: {reason}")
        return backend
    on_cpu = compute.device_type == "cpu"
    fast = backend_named("native" if on_cpu else "triton")
    reason = fast.unavailable(compute, differentiable=differentiable)
    if reason is None:
        if not on_cpu:
            _say_once(f"vnca: running the {fast.name} step on {compute.device_type}")
        return fast
    slow = backend_named("numpy" if on_cpu and not differentiable else "reference")
    problem = slow.unavailable(compute, differentiable=differentiable)
    if problem is not None:
        raise BackendUnavailableError(
            f"no backend can run: {fast.name}: {reason}; {slow.name}: {problem}"
        )
    _say_once(f"vnca: running the slow {slow.name} step: {reason}")
    return slow


def open_session(
    automaton: Automaton,
    domain: Domain,
    conditioning: Any,
    compute: Compute | None = None,
    *,
    differentiable: bool = False,
) -> Session:
    """An automaton on a domain, ready to run.

    Args:
        automaton: Weights, filters and mask.
        domain: The active cells.
        conditioning: `[n, P]` of the cells, an array or, for a differentiable session, a tensor.
        compute: How to compute; the fastest way on the CPU unless given.
        differentiable: Whether states are tensors through which gradients flow.

    Raises:
        BackendUnavailableError: If what was asked for cannot run here.
    """
    compute = compute or Compute()
    backend = choose(compute, differentiable=differentiable)
    return backend.session(Job(automaton, domain, conditioning, compute, differentiable))


@cache
def _say_once(line: str) -> None:
    print(line, file=sys.stderr)
