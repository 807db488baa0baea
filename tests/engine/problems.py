"""Steps that every backend has to do as the reference does, and what says whether it does."""

import dataclasses
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from vnca.core import AnyArray, FloatArray, IntArray
from vnca.engine import native
from vnca.engine.automaton import Weights, changing_rows, stencil
from vnca.engine.domain import Border, Domain

SEED, STEP = 0, 1
"""By which the cells that change are drawn."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """The arguments of a step, and a gradient of its result."""

    state: FloatArray
    rows: IntArray
    neighbours: IntArray
    priors: FloatArray
    hidden: FloatArray
    bias: FloatArray
    output: FloatArray
    stencil: FloatArray
    gradient: FloatArray
    domain: Domain

    def with_(self, **changes: AnyArray) -> "Problem":
        return dataclasses.replace(self, **changes)

    def forward(self, **options: object) -> FloatArray:
        return native.forward(*self._arrays[:-1], **options)  # pyright: ignore

    def backward(self, **options: object) -> tuple[FloatArray, ...]:
        return native.backward(*self._arrays, **options)  # pyright: ignore

    @property
    def _arrays(self) -> tuple[AnyArray, ...]:
        return tuple(getattr(self, field.name) for field in dataclasses.fields(self)[:-1])


def problem(
    shape: tuple[int, int, int] = (7, 9, 11),
    *,
    channels: int = 12,
    hidden: int = 32,
    priors: int = 7,
    occupancy: float = 1.0,
    probability: float = 0.5,
    border: Border = "replicate",
) -> Problem:
    random = np.random.default_rng(4)

    def draw(*lengths: int, scale: float = 1.0) -> FloatArray:
        return (scale * random.standard_normal(lengths)).astype(np.float32)

    domain = Domain.from_mask(random.random(shape) < occupancy, (-3, 0, 5), border=border)
    n = len(domain)
    state = draw(n + 1, channels)
    state[-1] = 0
    return Problem(
        state,
        changing_rows(domain.hashes, seed=SEED, step=STEP, probability=probability),
        domain.neighbours,
        draw(n, priors),
        draw(hidden, 5 * channels + priors, scale=0.1),
        draw(hidden, scale=0.1),
        draw(channels, hidden, scale=0.1),
        stencil(sobel_divisor=30.0),
        draw(n + 1, channels),
        domain,
    )


Update = Callable[..., Tensor]


def run(update: Update, p: Problem, dtype: torch.dtype, device: str = "cpu") -> dict[str, AnyArray]:
    """The new state and the gradients."""

    def tensor(array: AnyArray, *, trained: bool = False) -> Tensor:
        return torch.tensor(array, dtype=dtype, device=device, requires_grad=trained)

    state = tensor(p.state, trained=True)
    weights = Weights(*(tensor(w, trained=True) for w in (p.hidden, p.bias, p.output)))
    result = update(
        state,
        torch.tensor(p.rows, device=device),
        torch.tensor(p.neighbours, device=device),
        tensor(p.priors),
        weights,
        torch.tensor(p.stencil, dtype=torch.promote_types(dtype, torch.float32), device=device),
    )
    gradients = torch.autograd.grad(result, (state, *weights), tensor(p.gradient))
    names = ("state", "to_state", "to_hidden", "to_bias", "to_output")
    arrays = (
        t.detach().to(torch.promote_types(dtype, torch.float32)) for t in (result, *gradients)
    )
    return dict(zip(names, (t.numpy(force=True) for t in arrays), strict=True))


def assert_conforms(
    got: dict[str, AnyArray], expected: dict[str, AnyArray], *, atol: float = 3e-6
) -> None:
    for name, exact in expected.items():
        scale = np.abs(exact).max(initial=1e-30)
        np.testing.assert_allclose(got[name] / scale, exact / scale, atol=atol, err_msg=name)


CASES = {
    "paper": {"shape": (33, 8, 65), "hidden": 128, "occupancy": 0.8},
    "default": {"shape": (16, 17, 12), "hidden": 96},
    "one cell": {"shape": (1, 1, 1), "channels": 5, "hidden": 17, "priors": 0, "probability": 1},
    "one row of cells": {"shape": (1, 1, 65), "channels": 1, "hidden": 1, "priors": 1},
    "odd": {"channels": 5, "hidden": 17, "priors": 3, "occupancy": 0.4},
    "every cell changes": {"probability": 1, "hidden": 64},
    "no cell changes": {"probability": 1e-9},
    "no cell": {"occupancy": 0},
    "wraps": {"shape": (9, 3, 8), "border": "circular", "occupancy": 0.7},
    "wraps onto itself": {"shape": (2, 1, 3), "border": "circular", "probability": 1},
    "wide": {"shape": (5, 6, 7), "channels": 64, "hidden": 512, "priors": 16},
    "many channels": {"channels": 20, "hidden": 100, "priors": 2},
    "single brick": {"shape": (8, 8, 8), "hidden": 32},
    "all bricks": {"shape": (16, 8, 16), "hidden": 16},
    "7×9×11": {"shape": (7, 9, 11), "hidden": 96},
}  # fmt: skip
