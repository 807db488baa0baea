"""Decoding a state at points, written to be read; differentiable; float32 and float64."""

from itertools import product
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from vnca.kernels.decode.weights import OUTPUTS, Weights

SLAB = 1 << 14
"""Points worked through at a time: their hidden layers are computed again in the backward pass."""


def interpolate(corners: Tensor, fractions: Tensor) -> Tensor:
    """The state `[m, C]` between the cells, trilinear.

    Args:
        corners: `[8, m, C]` states around each point, z fastest.
        fractions: `[m, 3]` of the way from the first of them to the last.
    """
    total = torch.zeros_like(corners[0])
    for corner, part in zip(product((0, 1), repeat=3), corners, strict=True):
        upper = torch.tensor(corner, dtype=torch.bool, device=fractions.device)
        share = torch.where(upper, fractions, 1 - fractions).prod(dim=1, keepdim=True)
        total = total + share * part
    return total


def network(state: Tensor, weights: Weights) -> Tensor:
    """What is seen `[m, 4]` of states `[m, C]`: their first channels, changed by a small network.

    h₁ = sin(W₁ s + b₁), h₂ = sin(W₂ h₁ + b₂), h₃ = sin(W₃ h₂ + b₃), out = s[:4] + W₄ h₃ + b₄.

    Reference: Sitzmann et al. 2020, "Implicit Neural Representations with Periodic Activation
    Functions", equation 3; here of a state instead of a place.
    """
    hidden = torch.sin(state @ weights.first.t() + weights.first_bias)
    hidden = torch.sin(hidden @ weights.second.t() + weights.second_bias)
    hidden = torch.sin(hidden @ weights.third.t() + weights.third_bias)
    return state[:, :OUTPUTS] + hidden @ weights.output.t() + weights.output_bias


def decode(state: Tensor, rows: Tensor, fractions: Tensor, weights: Weights) -> Tensor:
    """What is seen at points between the cells of a state, not clamped.

    Differentiable, once, in the state and the weights. Points are worked through in slabs whose
    hidden layers the backward pass computes anew, so memory beyond the results does not grow.

    Args:
        state: `[n + 1, C]`, C at least 4; the last row is the outside, always zero.
        rows: `[8, m]` rows of the state around each point, z fastest, int32; n where nothing lives.
        fractions: `[m, 3]` of the way from the first of these cells to the last, 0 to 1.
        weights: Of the network.

    Returns:
        `[m, 4]`: colour as sRGB − ½, and Δd.
    """
    result = _Decode.apply(state, rows, fractions, *weights)
    assert isinstance(result, Tensor)
    return result


class _Decode(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *tensors: Tensor) -> Tensor:
        ctx.save_for_backward(*tensors)
        state, rows, fractions, *matrices = tensors
        result = state.new_empty(len(fractions), OUTPUTS)
        for slab in _slabs(fractions):
            between = interpolate(_gather(state, rows[:, slab]), fractions[slab])
            result[slab] = network(between, Weights(*matrices))
        return result

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        (gradient,) = grad_outputs
        state, rows, fractions, *matrices = ctx.saved_tensors
        weights = Weights(*(matrix.detach().requires_grad_() for matrix in matrices))
        to_state = torch.zeros_like(state)
        to_weights = [torch.zeros_like(matrix) for matrix in matrices]
        for slab in _slabs(fractions):
            around = _gather(state, rows[:, slab]).requires_grad_()
            with torch.enable_grad():
                seen = network(interpolate(around, fractions[slab]), weights)
            to_around, *parts = torch.autograd.grad(seen, (around, *weights), gradient[slab])
            to_state.index_add_(0, rows[:, slab].flatten().long(), to_around.flatten(0, 1))
            for total, part in zip(to_weights, parts, strict=True):
                total += part
        to_state[-1] = 0  # the outside is a constant
        return to_state, None, None, *to_weights


def _slabs(points: Tensor) -> list[slice]:
    return [slice(start, start + SLAB) for start in range(0, len(points), SLAB)]


def _gather(state: Tensor, rows: Tensor) -> Tensor:
    """States `[8, m, C]` at `rows`."""
    return state.index_select(0, rows.flatten()).view(*rows.shape, state.shape[1])
