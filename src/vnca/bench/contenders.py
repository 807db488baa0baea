"""Smoke-shaped cells to step on, and every backend's step of them, in the layout it works in.

Among them the step as the field writes it (`plain.py`): the fixed baseline.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from vnca.bench import onnx
from vnca.bench.plain import Grid, depthwise, input_order, plain_step
from vnca.core import AnyArray, BoolArray, FloatArray, Index, IntArray
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine import Compute, backend_named, choose
from vnca.engine.automaton import FILTERS, Automaton, Weights, changing_rows, stencil
from vnca.engine.domain import Domain
from vnca.engine.native import bricks
from vnca.rule import PRIORS

CHANNELS, PROBABILITY = 12, 0.5


def smoke(shape: tuple[int, int, int], share: float, seed: int = 0) -> tuple[AnyArray, BoolArray]:
    """A ragged rising column: density, and where there is some, about a `share` of all cells."""
    rng = np.random.default_rng(seed)
    x, y, z = np.meshgrid(*(np.linspace(-1, 1, n, dtype=np.float32) for n in shape), indexing="ij")
    field = -(x**2 + z**2) / (0.35 + 0.25 * y) ** 2
    for octave in range(1, 5):
        for _ in range(3):
            direction = rng.normal(size=3) * 2.0**octave * 2
            phase = rng.uniform(0, 6)
            field += 0.7**octave * np.sin(
                direction[0] * x + direction[1] * y + direction[2] * z + phase
            ).astype(np.float32)
    threshold = np.quantile(field[::4, ::4, ::4], 1 - share)
    active = field > threshold
    return np.where(active, field - threshold, 0).astype(np.float32), active


@dataclass(frozen=True)
class Case:
    """One step, the same for every backend, and a gradient of its result.

    Attributes:
        domain: The active cells.
        rows: `[m]` those that change.
        state: `[n + 1, C]`.
        priors: `[n, P]`.
        weights: W1, b1 and W2.
        gradient: `[n + 1, C]`.
    """

    domain: Domain
    rows: IntArray
    state: FloatArray
    priors: FloatArray
    weights: tuple[FloatArray, FloatArray, FloatArray]
    gradient: FloatArray

    @classmethod
    def draw(cls, grid: Index, hidden: int, occupancy: float) -> "Case":
        """Random values; with an occupancy under 1 only the cells of a ragged column are active."""
        random = np.random.default_rng(0)

        def normal(*shape: int, scale: float = 1.0) -> FloatArray:
            return scale * random.standard_normal(shape, dtype=np.float32)

        alive = np.ones(grid, dtype=bool) if occupancy >= 1 else smoke(grid, occupancy)[1]
        domain = Domain.from_mask(alive, (0, 0, 0))
        n = len(domain)
        state = normal(n + 1, CHANNELS)
        state[-1] = 0
        inputs = FILTERS * CHANNELS + PRIORS
        return cls(
            domain,
            changing_rows(domain.hashes, seed=0, step=0, probability=PROBABILITY),
            state,
            normal(n, PRIORS),
            (
                normal(hidden, inputs, scale=0.1),
                normal(hidden, scale=0.1),
                normal(CHANNELS, hidden, scale=0.1),
            ),
            normal(n + 1, CHANNELS),
        )

    @property
    def hidden(self) -> int:
        """Hidden units."""
        return len(self.weights[1])

    @property
    def occupancy(self) -> float:
        """Share of the grid's cells that are active."""
        return len(self.domain) / float(np.prod(self.domain.box.shape))

    def rounded(self, dtype: torch.dtype) -> "Case":
        """With values that a dtype can hold: what is compared is arithmetic, not input."""

        def near(array: FloatArray) -> FloatArray:
            return torch.from_numpy(array).to(dtype).float().numpy()

        hidden, bias, output = map(near, self.weights)
        return dataclasses.replace(
            self,
            state=near(self.state),
            priors=near(self.priors),
            weights=(hidden, bias, output),
            gradient=near(self.gradient),
        )


class Place(NamedTuple):
    """Where a backend computes, and with which numbers."""

    device: str
    dtype: torch.dtype

    def tensor(self, values: FloatArray | Tensor) -> Tensor:
        """A copy there."""
        return torch.as_tensor(values).to(self.device, self.dtype, copy=True)


BACKENDS = ("plain", "compile", "onnx", "reference", "native", "triton")
"""`compile` is `plain` under `torch.compile`, `onnx` the same in ONNX Runtime, forward only."""
TRAINABLE = tuple(name for name in BACKENDS if name != "onnx")
"""Those with gradients."""
PASSES = ("forward", "backward", "both")
DTYPES = {
    "float32": torch.float32,
    "tf32": torch.float32,
    "float16": torch.float16,
    "bfloat16": torch.bfloat16,
}
"""Of states, weights and products; `tf32` is float32 whose products may round to 10 bits. The
native kernel keeps states in float32."""


class Contender(NamedTuple):
    """A step in a backend's own layout.

    Attributes:
        step: The new state from the inputs.
        inputs: State, W1, b1 and W2.
        gradient: Of the new state.
        listed: Brings a new state and gradients of the inputs into the layout of a `Case`.
        has_gradients: Whether it has other passes than forward.
    """

    step: Callable[..., Tensor]
    inputs: tuple[Tensor, ...]
    gradient: Tensor
    listed: Callable[..., tuple[Tensor, ...]]
    has_gradients: bool = True

    def begin(self, part: str) -> Callable[[], tuple[Tensor, ...]]:
        """What a pass does, with all done that comes before it."""
        if part == "backward":
            return partial(self._gradients, self.step(*self.inputs))
        return {"forward": self._forward, "both": self._both}[part]

    def _forward(self) -> tuple[Tensor, ...]:
        with torch.no_grad():
            return (self.step(*self.inputs),)

    def _gradients(self, result: Tensor) -> tuple[Tensor, ...]:
        return torch.autograd.grad(result, self.inputs, self.gradient)

    def _both(self) -> tuple[Tensor, ...]:
        result = self.step(*self.inputs)
        return result.detach(), *self._gradients(result)


def contender(case: Case, name: str, place: Place, *, threads: int) -> Contender:
    """A backend, ready to take a step.

    Raises:
        BackendUnavailableError: If it cannot run there.
    """
    if name in ("plain", "compile", "onnx"):
        return _dense(case, place, name, threads=threads)
    return _packaged(case, name, place, threads=threads)


def available(dtype: str, device: str) -> tuple[str, ...]:
    """The backends that can run with numbers of that type on that kind of device."""
    return tuple(name for name in BACKENDS if _why_not(name, dtype, device) is None)


def require(name: str, dtype: str, device: str) -> None:
    """Refuse a backend that cannot run.

    Raises:
        BackendUnavailableError: With the reason.
        OptionError: If there is none of that name.
    """
    if name not in BACKENDS:
        raise OptionError(f"`backends` {name}: expected {', '.join(BACKENDS)}")
    reason = _why_not(name, dtype, device)
    if reason is not None:
        raise BackendUnavailableError(f"`backends` {name}: {reason}")


def _why_not(name: str, dtype: str, device: str) -> str | None:
    if name == "plain":
        return None
    if name == "compile":
        return _why_not_compiled(device)
    if name == "onnx":
        is_here = device == "cpu" and dtype == "float32"
        return onnx.unavailable() if is_here else f"compared in float32 on the CPU, not {dtype}"
    try:
        backend = choose(Compute(name, device), differentiable=True)
    except BackendUnavailableError as error:
        return str(error)
    if name != "native" or dtype == "float32":
        return None
    if dtype != "bfloat16":
        return f"the native kernel computes in float32 or bfloat16, not in {dtype}"
    return backend.unavailable(Compute(name, precision=dtype))


@cache
def _why_not_compiled(device: str) -> str | None:
    try:
        torch.compile(torch.relu)(torch.zeros(2, device=device))
    except Exception as error:  # it needs a compiler, headers and more, and fails in many ways
        return f"torch.compile does not work here: {str(error).strip().splitlines()[0]}"
    return None


def _dense(case: Case, place: Place, name: str, *, threads: int) -> Contender:
    """The plain step, as it is, compiled, or in ONNX Runtime."""
    domain, grid = case.domain, Grid(case.domain, place.device)
    changing = torch.zeros(len(domain), 1)
    changing[torch.from_numpy(case.rows).long()] = 1
    mask, priors = (grid.spread(place.tensor(t)) for t in (changing, case.priors))
    filters = depthwise(place.tensor(stencil()), CHANNELS)
    order = input_order(CHANNELS, PRIORS)

    def step(state: Tensor, hidden: Tensor, bias: Tensor, output: Tensor) -> Tensor:
        return apply(state, mask, priors, filters, hidden, bias, output)

    def listed_state(state: Tensor, *_: Tensor) -> tuple[Tensor, ...]:
        return (grid.collect(state),)

    def listed(
        state: Tensor, to_state: Tensor, to_hidden: Tensor, to_bias: Tensor, to_output: Tensor
    ) -> tuple[Tensor, ...]:
        back = order.argsort().to(to_hidden.device)
        return (
            grid.collect(state),
            grid.collect(to_state),
            to_hidden.flatten(1)[:, back],
            to_bias,
            to_output.flatten(1),
        )

    apply = torch.compile(plain_step) if name == "compile" else plain_step
    hidden, bias, output = case.weights
    inputs = (
        grid.spread(place.tensor(case.state[:-1])),
        place.tensor(hidden[:, order.numpy(), None, None, None]),
        place.tensor(bias),
        place.tensor(output[..., None, None, None]),
    )
    gradient = grid.spread(place.tensor(case.gradient[:-1]))
    if name == "onnx":
        run = onnx.onnx_step(
            *(each.numpy() for each in (mask, priors, filters, *inputs[1:])), threads=threads
        )
        return Contender(
            lambda state, *_: torch.from_numpy(run(state.numpy())),
            inputs,
            gradient,
            listed_state,
            has_gradients=False,
        )
    return Contender(step, tuple(t.requires_grad_() for t in inputs), gradient, listed)


def _packaged(case: Case, name: str, place: Place, *, threads: int) -> Contender:
    """A backend of vnca, on the list of active cells."""
    precision = "float32"
    if name == "native" and place.dtype == torch.bfloat16:
        # It rounds the factors of its products itself; states and sums stay float32.
        precision, place = "bfloat16", Place(place.device, torch.float32)
    update = backend_named(name).update(threads=threads, precision=precision)
    rows, neighbours = (
        torch.from_numpy(array).to(place.device) for array in (case.rows, case.domain.neighbours)
    )
    priors = place.tensor(case.priors)
    # The fast kernels read from it what the filters are multiples of, and want it exact.
    filters = torch.from_numpy(stencil()).to(place.device)
    if name == "reference":
        filters = filters.to(place.dtype)

    def step(state: Tensor, *weights: Tensor) -> Tensor:
        return update(state, rows, neighbours, priors, Weights(*weights), filters)

    if name == "native":
        step = partial(_native_step, step, case, {"threads": threads, "precision": precision})
    inputs = tuple(place.tensor(array).requires_grad_() for array in (case.state, *case.weights))
    return Contender(step, inputs, place.tensor(case.gradient), lambda *results: results)


def _native_step(
    with_gradients: Callable[..., Tensor],
    case: Case,
    options: dict[str, Any],
    state: Tensor,
    *weights: Tensor,
) -> Tensor:
    """The native step as its sessions take it: in bricks, where no gradient is wanted."""
    if torch.is_grad_enabled():
        return with_gradients(state, *weights)
    arrays = Weights(*(each.detach().numpy() for each in weights))
    automaton = Automaton(arrays, stencil(), PROBABILITY, seed=0)
    hashes = case.domain.hashes.view(np.int32)
    inputs = (state.detach().numpy(), case.domain.around, hashes, case.priors, automaton, 0)
    return torch.from_numpy(bricks.forward(*inputs, **options))
