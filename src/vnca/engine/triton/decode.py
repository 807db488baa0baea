"""Decoding on NVIDIA GPUs in torch's automatic differentiation, computed by Triton kernels."""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from vnca.core.errors import ShapeError
from vnca.engine.automaton import CORNERS, OUTPUTS, DecoderWeights
from vnca.engine.triton.step import (
    LARGEST,
    OPTIONS,
    Precision,
    default_precision,
    programs,
    require_layout,
)

try:
    import triton

    from vnca.engine.triton import decode_kernels as triton_kernels
except (ImportError, AttributeError):  # as `vnca.engine.triton.step.unavailable` says
    triton: Any = None
    triton_kernels: Any = None

TILES = 64, 16, 64
"""Points that a program works on at a time in the forward pass and in the network's gradient, and
cells in the state's."""
WARPS = 4, 8, 4
"""Of 32 threads, in a program of each of them."""
NETWORK_PRECISION: Precision = "ieee"
"""Of the network's gradient whatever is asked for: its products are so small that in three parts
they take more registers than a thread has."""
MOST_CHANNELS, MOST_UNITS = 32, 32
"""What fits into a multiprocessor together with its gradient."""


def decode(
    state: Tensor,
    rows: Tensor,
    fractions: Tensor,
    weights: DecoderWeights,
    *,
    precision: Precision | None = None,
) -> Tensor:
    """What is seen at points, as `vnca.engine.reference.equations.decode` has it.

    Differentiable, once, in the state and the weights. The backward pass computes the hidden layers
    anew, and keeps C floats and 8 integers a point. The same bits in every run on one kind of GPU.

    Args:
        state: `[n + 1, C]`, float32, float16 or bfloat16; the last row is the outside, always
            zero. All is computed in float32.
        rows: `[8, m]` rows of the state around each point, z fastest, int32; n for the outside;
            not checked.
        fractions: `[m, 3]` of the way from the first of these cells to the last, 0 to 1.
        weights: Of the network.
        precision: Of the products; by default `tf32x3`, or `tf32` if torch is told that this is
            enough (`torch.set_float32_matmul_precision`).

    Returns:
        `[m, 4]`, of the type of the state.

    Raises:
        ShapeError: If shapes or types are not as above, or too large.
    """
    _check(state, rows, fractions, weights)
    result = _Decode.apply(state, rows, fractions, *weights, precision or default_precision())
    assert isinstance(result, Tensor)
    return result


class _Decode(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> Tensor:
        *tensors, ctx.precision = inputs
        tensors = [tensor.contiguous() for tensor in tensors]
        ctx.save_for_backward(*tensors)
        state, _, fractions = tensors[:3]
        points = len(fractions)
        out = state.new_empty(points, OUTPUTS)
        if points:
            sizes = _sizes(tensors, TILES[0])
            with torch.cuda.device_of(state):
                triton_kernels.forward_kernel[(programs(points, TILES[0], state.device),)](
                    *tensors,
                    out,
                    points,
                    **sizes,
                    PRECISION=ctx.precision,
                    num_warps=WARPS[0],
                    **OPTIONS,
                )
        return out

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        gradient = grad_outputs[0].contiguous()
        state, rows, fractions, *weights = tensors = ctx.saved_tensors
        points, cells = len(fractions), len(state) - 1
        sizes = _sizes(tensors, TILES[1])
        count = programs(points, TILES[1], state.device)
        lengths = [weight.numel() for weight in weights]
        partials = state.new_empty((count, sum(lengths)), dtype=torch.float32)
        to_between = state.new_empty((points, state.shape[1]), dtype=torch.float32)
        to_state = torch.zeros_like(state)
        if points:
            found, order = torch.sort(rows.flatten(), stable=True)
            every = torch.arange(cells + 1, dtype=torch.int32, device=rows.device)
            begin = torch.searchsorted(found, every, out_int32=True)
            with torch.cuda.device_of(state):
                triton_kernels.network_kernel[(count,)](
                    *tensors,
                    gradient,
                    to_between,
                    partials,
                    points,
                    **sizes,
                    PRECISION=NETWORK_PRECISION,
                    num_warps=WARPS[1],
                    **OPTIONS,
                )
                triton_kernels.state_kernel[(triton.cdiv(cells + 1, TILES[2]),)](
                    to_between,
                    fractions,
                    order.int(),
                    begin,
                    to_state,
                    points,
                    cells,
                    sizes["C"],
                    sizes["WIDTH"],
                    TILES[2],
                    num_warps=WARPS[2],
                    **OPTIONS,
                )
        parts = partials.sum(0).split(lengths)
        to_weights = (
            (part.view(weight.shape[::-1]).t() if weight.ndim == 2 else part).to(weight.dtype)
            for part, weight in zip(parts, weights, strict=True)
        )
        return to_state, None, None, *to_weights, None


def _sizes(tensors: Sequence[Tensor], tile: int) -> dict[str, int]:
    """What the kernels are compiled for."""
    units, channels = tensors[3].shape
    return {
        "C": channels,
        "H": units,
        "WIDTH": max(16, triton.next_power_of_2(channels)),
        "UNITS": max(16, triton.next_power_of_2(units)),
        "TILE": tile,
    }


def _check(state: Tensor, rows: Tensor, fractions: Tensor, weights: DecoderWeights) -> None:
    """Everything but the values of rows, which the CPU does not know."""
    n, c = state.shape if state.ndim == 2 else (0, 0)
    m, units = (t.shape[0] if t.ndim else 0 for t in (fractions, weights.first))
    shapes = {
        "state": (state, (n, c)),
        "rows": (rows, (CORNERS, m)),
        "fractions": (fractions, (m, 3)),
    }
    named = zip(DecoderWeights._fields, weights, DecoderWeights.shapes(c, units), strict=True)
    shapes |= {name.replace("_", " "): (weight, shape) for name, weight, shape in named}
    require_layout("decoding", shapes, ("rows",))
    if not (OUTPUTS <= c <= MOST_CHANNELS and 1 <= units <= MOST_UNITS and n >= 1):
        raise ShapeError(
            f"decoding: {n} rows of {c} channels, {units} units: the Triton kernels work with at "
            f"least 1 row of {OUTPUTS} to {MOST_CHANNELS} channels and 1 to {MOST_UNITS} units"
        )
    if max(CORNERS, c) * m > LARGEST or n * c > LARGEST:
        raise ShapeError(
            f"decoding: {m} points, {n} rows of {c} channels: too many for the 32-bit offsets of "
            "the Triton kernels"
        )
