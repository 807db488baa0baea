"""Where an automaton is computed: sessions, which hold it there, and the backends that open them.

A backend is one file or folder here, with a `BACKEND` in it, and its name in `BACKENDS`. It opens
sessions, which hold all that a step needs where it is computed; and decodes their states.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from vnca.core import FloatArray
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine.automaton import Automaton, Weights
from vnca.engine.device import device_named, say_once
from vnca.engine.domain import Domain

BACKENDS = ("native", "triton", "wgsl", "numpy", "reference")
"""Names of backends, each that of its folder, the fastest on its kind of device first."""
ON_CPU = ("native", "numpy", "wgsl")
"""Those for which torch has to find no GPU: they work on the CPU, or find one themselves."""
PRECISIONS = ("float32", "bfloat16")
"""What the native backend may round factors of products to; states and sums stay float32."""
ROUNDED_BY = {"bfloat16": "native", "float16": "wgsl"}
"""The backend that rounds to each of what is not float32."""


@dataclass(frozen=True)
class Compute:
    """How to compute."""

    backend: str = "auto"
    """auto takes the fastest that is there; native, triton, wgsl, numpy or reference that one."""
    device: str = "cpu"
    """cpu, cuda, or one of several GPUs, such as cuda:1; see `device_named`."""
    precision: str = "float32"
    """What factors of products are rounded to: bfloat16 by native, float16 by wgsl is quicker."""
    threads: int | None = None
    """Threads of the native backend; one for each core unless given."""

    def __post_init__(self) -> None:
        if self.backend not in ("auto", *BACKENDS):
            raise OptionError(f"`backend` {self.backend}: expected auto, {', '.join(BACKENDS)}")
        if self.precision not in ("float32", *ROUNDED_BY):
            raise OptionError(f"`precision` {self.precision}: not float32, {', '.join(ROUNDED_BY)}")
        if self.threads is not None and self.threads < 1:
            raise OptionError(f"`threads` {self.threads}: at least 1 is needed")

    @property
    def device_type(self) -> str:
        """Kind of the device, as torch names it."""
        return self.device.partition(":")[0]


@dataclass(frozen=True, eq=False)
class Job:
    """What a session is opened for.

    Attributes:
        automaton: Weights, filters and mask.
        domain: The active cells.
        conditioning: `[n, P]` of the cells.
        compute: How to compute.
        differentiable: Whether states are tensors through which gradients flow.
    """

    automaton: Automaton
    domain: Domain
    conditioning: Any
    compute: Compute
    differentiable: bool


class Session(ABC):
    """An automaton on the active cells of a domain.

    What `upload` returns is a state in the backend's own arrays; nothing but `read` brings it back.
    """

    @abstractmethod
    def upload(self, state: FloatArray) -> Any:
        """A state `[n + 1, C]`, last row zero, where it is computed."""

    @abstractmethod
    def step(self, state: Any, number: int) -> Any:
        """The state after the step of a number, from which its mask follows.

        Differentiable in the state and the weights if the session was opened so.
        """

    @abstractmethod
    def read(self, state: Any) -> FloatArray:
        """The state as a numpy array."""

    @abstractmethod
    def conditioned(self, conditioning: Any) -> "Session":
        """The same automaton on the same cells, conditioned on something else, `[n, P]`."""

    def steered(self, steering: Any) -> "Session":
        """The same with what each cell perceives turned and scaled by a matrix, `[n, 3, 3]`.

        It perceives F ∇s and |F|²/3 · ∇²s: by a rotation, as if all around it were turned by that;
        by k, as if it were k times as small, so that the pattern becomes k times as large.
        """
        raise NotImplementedError(f"{type(self).__name__} of a backend that does not steer")

    def run(self, state: Any, numbers: range, watch: Callable[[], None] | None = None) -> Any:
        """The state after the steps of some numbers; `watch` is called after each."""
        for number in numbers:
            state = self.step(state, number)
            if watch is not None:
                watch()
        return state


@dataclass(frozen=True, eq=False)
class StepSession(Session):
    """A session that draws the rows of cells that change, then updates them: of most backends.

    Attributes:
        automaton: Its weights are where the rest is.
        neighbours: `[27, n]` rows of the state around each active cell.
        hashes: `[n]` for the mask, the bits as int32.
        stencil: `[5, 27]`.
        conditioning: `[n, P]`.
        draw: The rows `[m]` that change, from hashes, seed, step and probability.
        update: The step, called as `vnca.engine.reference.equations.update` is.
        place: Brings an array to where it is computed.
        back: Brings one from there.
        steering: `[n, 3, 3]`; None where cells are not steered.
    """

    automaton: Automaton
    neighbours: Any
    hashes: Any
    stencil: Any
    conditioning: Any
    draw: Callable[..., Any]
    update: Callable[..., Any]
    place: Callable[[Any], Any]
    back: Callable[[Any], FloatArray]
    steering: Any = None

    @classmethod
    def open(
        cls,
        job: Job,
        *,
        draw: Callable[..., Any],
        update: Callable[..., Any],
        place: Callable[[Any], Any] = np.asarray,
        back: Callable[[Any], FloatArray] = np.asarray,
    ) -> "StepSession":
        """Bring everything to its place; without one it stays in main memory."""
        automaton = job.automaton
        return cls(
            replace(automaton, weights=Weights(*map(place, automaton.weights))),
            place(job.domain.neighbours),
            place(job.domain.hashes.view(np.int32)),
            place(automaton.stencil),
            place(job.conditioning),
            draw,
            update,
            place,
            back,
        )

    def conditioned(self, conditioning: Any) -> "StepSession":
        """See `Session.conditioned`."""
        return replace(self, conditioning=self.place(conditioning))

    def steered(self, steering: Any) -> "StepSession":
        """See `Session.steered`."""
        return replace(self, steering=self.place(steering))

    def upload(self, state: FloatArray) -> Any:
        """See `Session.upload`."""
        return self.place(state)

    def step(self, state: Any, number: int) -> Any:
        """See `Session.step`."""
        automaton = self.automaton
        rows = self.draw(
            self.hashes,
            seed=automaton.seed,
            step=number,
            probability=automaton.update_probability,
        )
        how = (self.neighbours, self.conditioning, automaton.weights, self.stencil)
        steering = {} if self.steering is None else {"steering": self.steering}
        return self.update(state, rows, *how, **steering)

    def read(self, state: Any) -> FloatArray:
        """See `Session.read`."""
        return self.back(state)


class ArrayDecode(NamedTuple):
    """Decoding of arrays.

    Attributes:
        decode: What is seen at points, called as `vnca.engine.native.decoding.decode` is.
        decode_parts: What the parts of cells show, called as `native.decoding.decode_parts` is.
    """

    decode: Callable[..., FloatArray]
    decode_parts: Callable[..., tuple[FloatArray, FloatArray]]


class Backend(ABC):
    """One way to compute steps, and to decode the states they lead to.

    Attributes:
        name: As a user asks for it.
        precisions: Those it can round the factors of its products to.
        has_gradients: Whether its sessions can be differentiable.
        steers: Whether they can be steered.
    """

    name: str
    precisions: tuple[str, ...] = ("float32",)
    has_gradients = True
    steers = False

    def unavailable(
        self, compute: Compute, *, differentiable: bool = False, steered: bool = False
    ) -> str | None:
        """Why it cannot compute so here, or nothing if it can."""
        if steered and not self.steers:
            return "it cannot steer patterns; use native, numpy or reference"
        if differentiable and not self.has_gradients:
            return "it has no gradients; use reference"
        if compute.precision not in self.precisions:
            return f"only {ROUNDED_BY[compute.precision]} has {compute.precision}; use float32"
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

    def decode(self, *, threads: int | None = None) -> Callable[..., Any]:
        """Differentiable decoding of tensors, called as that of the reference is.

        Raises:
            BackendUnavailableError: If the backend has none.
        """
        del threads
        raise BackendUnavailableError(f"backend {self.name} does not decode tensors")

    def array_decode(self, *, threads: int | None = None) -> "ArrayDecode":
        """Decoding of arrays: numpy's, unless the backend has its own."""
        return backend_named("numpy").array_decode(threads=threads)


def compute_of(backend: str, device: str, precision: str = "float32") -> Compute:
    """How to compute as a user asks, where the device may be left to what is there.

    Of backends that work on the CPU alone, `auto` takes that.

    Raises:
        OptionError: If there is no such device, or torch cannot compute on it.
    """
    if device == "auto" and (backend in ON_CPU or precision != "float32"):
        device = "cpu"
    return Compute(backend, device_named(device), precision)


def backend_named(name: str) -> Backend:
    """A registered backend, of a name in `BACKENDS`."""
    return import_module(f"vnca.engine.{name}").BACKEND


def choose(compute: Compute, *, differentiable: bool = False, steered: bool = False) -> Backend:
    """The backend to run; one that can be differentiated or steered if that is asked for.

    `auto` says once on stderr what it takes if that is no fast one, or if it computes on a GPU.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here, or not so.
    """
    asked = {"differentiable": differentiable, "steered": steered}
    if compute.backend != "auto":
        backend = backend_named(compute.backend)
        reason = backend.unavailable(compute, **asked)
        if reason is not None:
            raise BackendUnavailableError(f"backend {backend.name} cannot run: {reason}")
        return backend
    on_cpu = compute.device_type == "cpu"
    fast = backend_named("native" if on_cpu else "triton")
    reason = fast.unavailable(compute, **asked)
    if reason is None:
        if not on_cpu:
            say_once(f"vnca: running the {fast.name} step on {compute.device_type}")
        return fast
    slow = backend_named("numpy" if on_cpu and not differentiable else "reference")
    problem = slow.unavailable(compute, **asked)
    if problem is not None:
        raise BackendUnavailableError(
            f"no backend can run: {fast.name}: {reason}; {slow.name}: {problem}"
        )
    say_once(f"vnca: running the slow {slow.name} step: {reason}")
    return slow


def open_session(
    automaton: Automaton,
    domain: Domain,
    conditioning: Any,
    compute: Compute | None = None,
    *,
    differentiable: bool = False,
    steered: bool = False,
) -> Session:
    """An automaton on a domain, ready to run.

    Args:
        automaton: Weights, filters and mask.
        domain: The active cells.
        conditioning: `[n, P]` of the cells, an array or, for a differentiable session, a tensor.
        compute: How to compute; the fastest way on the CPU unless given.
        differentiable: Whether states are tensors through which gradients flow.
        steered: Whether cells are to be steered: see `Session.steered`.

    Raises:
        BackendUnavailableError: If what was asked for cannot run here.
    """
    compute = compute or Compute()
    backend = choose(compute, differentiable=differentiable, steered=steered)
    return backend.session(Job(automaton, domain, conditioning, compute, differentiable))


def torch_decode(
    backend: str = "auto", *, device: str = "cpu", threads: int | None = None
) -> Callable[..., Any]:
    """Differentiable decoding of tensors by the backend that would step them.

    Args:
        backend: `auto`, or one in `BACKENDS` that takes tensors.
        device: Kind of device that holds the state, as torch names it.
        threads: How many the native kernel uses.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here.
        OptionError: If there is no backend of that name.
    """
    return choose(Compute(backend, device), differentiable=True).decode(threads=threads)


def array_decode(backend: str = "auto", *, threads: int | None = None) -> ArrayDecode:
    """Decoding of arrays, without torch; arguments and errors are those of `torch_decode`."""
    # Triton and the reference decode tensors only: what they computed is read back first.
    backend = {"triton": "auto", "reference": "numpy"}.get(backend, backend)
    return choose(Compute(backend)).array_decode(threads=threads)
