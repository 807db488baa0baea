"""The reference: one step of the automaton, and decoding its state at points.

Written to be read; differentiable; float32 and float64.
"""

from itertools import product
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from vnca.engine.automaton import OUTPUTS, DecoderWeights, Weights

SLAB = 4096
"""Cells worked through at a time: their perception and hidden layer stay in cache."""


def perceive(neighbourhood: Tensor, stencil: Tensor, steering: Tensor | None = None) -> Tensor:
    """Perception z: the cell's state, its gradient along x, y and z, and its Laplacian.

    Steered by F, a cell perceives F ∇s and |F|²/3 · ∇²s: by a rotation, what it would perceive if
    all around it had been turned by that; by a multiple k, if it had shrunk k times.

    Args:
        neighbourhood: `[27, cells, C]` states around each cell, in the order of `OFFSETS`.
        stencil: `[5, 27]`.
        steering: `[cells, 3, 3]`.

    Returns:
        `[cells, 5C]`, one filter after the other.

    Reference: VNCA, equation for z_ijk; Randazzo et al. 2023, "Growing Steerable Neural Cellular
    Automata", section 3 (turned gradients).
    """
    _, cells, channels = neighbourhood.shape
    filtered = (stencil @ neighbourhood.flatten(1)).view(len(stencil), cells, channels)
    if steering is not None:
        state, gradient, laplacian = filtered[0], filtered[1:4], filtered[4]
        gradient = torch.einsum("nij,jnc->inc", steering, gradient)
        laplacian = steering.square().sum((1, 2))[:, None] / 3 * laplacian
        filtered = torch.cat([state[None], gradient, laplacian[None]])
    return filtered.transpose(0, 1).flatten(1)


def change(
    neighbourhood: Tensor,
    priors: Tensor,
    weights: Weights,
    stencil: Tensor,
    steering: Tensor | None = None,
) -> Tensor:
    """∂s/∂t `[cells, C]` = W2 relu(W1 [z ‖ priors] + b1).

    Reference: VNCA, equation for ∂s_ijk/∂t, with the velocity that its text and figure have.
    """
    z = torch.cat([perceive(neighbourhood, stencil, steering), priors], dim=1)
    hidden = torch.relu(torch.addmm(weights.bias, z, weights.hidden.t()))
    return hidden @ weights.output.t()


def update(
    state: Tensor,
    rows: Tensor,
    neighbours: Tensor,
    priors: Tensor,
    weights: Weights,
    stencil: Tensor,
    steering: Tensor | None = None,
) -> Tensor:
    """The state after one step: s' = s + change on `rows`, s elsewhere.

    Differentiable in the state and the weights. Cells are worked through in slabs, and the
    backward pass recomputes a slab's hidden layer, so memory beyond the two states does not grow
    with the grid.

    Args:
        state: `[n + 1, C]`; the last row is the outside, always zero.
        rows: `[m]` cells that change in this step, int32, each at most once.
        neighbours: `[27, n]` rows of the state around each cell, int32; n for the outside.
        priors: `[n, P]`.
        weights: W1, b1 and W2.
        stencil: `[5, 27]` perception filters.
        steering: `[n, 3, 3]`; see `perceive`.

    Returns:
        `[n + 1, C]`.
    """
    result = _Update.apply(state, rows, neighbours, priors, *weights, stencil, steering)
    assert isinstance(result, Tensor)
    return result


class _Update(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        state: Tensor,
        rows: Tensor,
        neighbours: Tensor,
        priors: Tensor,
        hidden: Tensor,
        bias: Tensor,
        output: Tensor,
        stencil: Tensor,
        steering: Tensor | None,
    ) -> Tensor:
        fixed = (rows, neighbours, priors, hidden, bias, output, stencil, steering)
        ctx.save_for_backward(state, *fixed)
        weights = Weights(hidden, bias, output)
        result = state.clone()
        for slab in rows.split(SLAB):
            around = _gather(state, neighbours, slab)
            turned = None if steering is None else steering[slab]
            result[slab] += change(around, priors[slab], weights, stencil, turned)
        return result

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor | None, ...]:
        (gradient,) = grad_outputs
        state, rows, neighbours, priors, *matrices, stencil, steering = ctx.saved_tensors
        weights = Weights(*(matrix.detach().requires_grad_() for matrix in matrices))
        to_state = gradient.clone()
        to_weights = [torch.zeros_like(matrix) for matrix in matrices]
        for slab in rows.split(SLAB):
            around = _gather(state, neighbours, slab).requires_grad_()
            turned = None if steering is None else steering[slab]
            with torch.enable_grad():
                changed = change(around, priors[slab], weights, stencil, turned)
            to_around, *slab_weights = torch.autograd.grad(
                changed, (around, *weights), gradient[slab]
            )
            to_state.index_add_(0, neighbours[:, slab].flatten().long(), to_around.flatten(0, 1))
            for total, part in zip(to_weights, slab_weights, strict=True):
                total += part
        to_state[-1] = 0  # the outside is a constant
        return to_state, None, None, None, *to_weights, None, None


def _gather(state: Tensor, neighbours: Tensor, rows: Tensor) -> Tensor:
    """States `[27, cells, C]` around the cells in `rows`."""
    around = neighbours.index_select(1, rows)
    return state.index_select(0, around.flatten()).view(*around.shape, state.shape[1])


POINT_SLAB = 1 << 14
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


def network(state: Tensor, weights: DecoderWeights) -> Tensor:
    """What is seen `[m, 4]` of states `[m, C]`: their first channels, changed by a small network.

    h₁ = sin(W₁ s + b₁), h₂ = sin(W₂ h₁ + b₂), h₃ = sin(W₃ h₂ + b₃), out = s[:4] + W₄ h₃ + b₄.

    Reference: Sitzmann et al. 2020, "Implicit Neural Representations with Periodic Activation
    Functions", equation 3; here of a state instead of a place.
    """
    hidden = torch.sin(state @ weights.first.t() + weights.first_bias)
    hidden = torch.sin(hidden @ weights.second.t() + weights.second_bias)
    hidden = torch.sin(hidden @ weights.third.t() + weights.third_bias)
    return state[:, :OUTPUTS] + hidden @ weights.output.t() + weights.output_bias


def decode(state: Tensor, rows: Tensor, fractions: Tensor, weights: DecoderWeights) -> Tensor:
    """What is seen at points between the cells of a state, not clamped.

    Differentiable, once, in the state and the weights. Points are worked through in slabs whose
    hidden layers the backward pass computes anew, so memory beyond the results does not grow.

    Args:
        state: `[n + 1, C]`, C at least 4; the last row is the outside, always zero.
        rows: `[8, m]` rows of the state around each point, z fastest, int32; n for the outside.
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
            between = interpolate(_gather_corners(state, rows[:, slab]), fractions[slab])
            result[slab] = network(between, DecoderWeights(*matrices))
        return result

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        (gradient,) = grad_outputs
        state, rows, fractions, *matrices = ctx.saved_tensors
        weights = DecoderWeights(*(matrix.detach().requires_grad_() for matrix in matrices))
        to_state = torch.zeros_like(state)
        to_weights = [torch.zeros_like(matrix) for matrix in matrices]
        for slab in _slabs(fractions):
            around = _gather_corners(state, rows[:, slab]).requires_grad_()
            with torch.enable_grad():
                seen = network(interpolate(around, fractions[slab]), weights)
            to_around, *parts = torch.autograd.grad(seen, (around, *weights), gradient[slab])
            to_state.index_add_(0, rows[:, slab].flatten().long(), to_around.flatten(0, 1))
            for total, part in zip(to_weights, parts, strict=True):
                total += part
        to_state[-1] = 0  # the outside is a constant
        return to_state, None, None, *to_weights


def _slabs(points: Tensor) -> list[slice]:
    return [slice(start, start + POINT_SLAB) for start in range(0, len(points), POINT_SLAB)]


def _gather_corners(state: Tensor, rows: Tensor) -> Tensor:
    """States `[8, m, C]` at `rows`."""
    return state.index_select(0, rows.flatten()).view(*rows.shape, state.shape[1])
