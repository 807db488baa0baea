"""The native step and decoding in torch's automatic differentiation; float32 on the CPU."""

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from vnca.engine import native
from vnca.engine.automaton import DecoderWeights, Weights
from vnca.engine.native import decoding


def update(
    state: Tensor,
    rows: Tensor,
    neighbours: Tensor,
    priors: Tensor,
    weights: Weights,
    stencil: Tensor,
    steering: Tensor | None = None,
    *,
    threads: int | None = None,
    precision: str = "float32",
) -> Tensor:
    """The state after one step, as `vnca.engine.reference.equations.update` has it.

    Differentiable, once, in the state and the weights. Beyond the two states, memory is kept for
    nothing: the backward pass computes the hidden layer anew.

    Args:
        state: `[n + 1, C]`; the last row is the outside, always zero.
        rows: `[m]` cells that change in this step, int32, ascending.
        neighbours: `[27, n]` rows of the state around each cell, int32; n for the outside.
        priors: `[n, P]`.
        weights: W1, b1 and W2.
        stencil: `[5, 27]` perception filters.
        steering: `[n, 3, 3]`; see `vnca.engine.native.forward`.
        threads: How many to use; by default one for each core.
        precision: What the factors of the products are rounded to, forward and backward.

    Raises:
        BackendUnavailableError: If the native kernel was not built, or has no such precision here.
        ShapeError: If shapes, types or indices are not as above.
    """
    fixed = (rows, neighbours, priors, *weights, stencil, steering)
    result = _Update.apply(state, *fixed, threads, precision)
    assert isinstance(result, Tensor)
    return result


def changing_tensor_rows(hashes: Tensor, *, seed: int, step: int, probability: float) -> Tensor:
    """Rows `[m]` of the cells that change, as `native.changing_rows` draws them."""
    rows = native.changing_rows(array_of(hashes), seed=seed, step=step, probability=probability)
    return torch.from_numpy(rows)


class _Update(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> Tensor:
        *tensors, threads, precision = inputs
        ctx.options = {"threads": threads, "precision": precision}
        ctx.save_for_backward(*tensors)
        return torch.from_numpy(native.forward(*map(array_of, tensors), **ctx.options))

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        *tensors, steering = ctx.saved_tensors
        arrays = map(array_of, (*tensors, *grad_outputs, steering))
        to_state, *to_weights = map(torch.from_numpy, native.backward(*arrays, **ctx.options))
        return to_state, None, None, None, *to_weights, None, None, None, None


def array_of(tensor: Tensor | None) -> Any:
    """What the native core takes of a tensor on the CPU: the same numbers, if they lie in a row."""
    return None if tensor is None else tensor.detach().contiguous().numpy()


def decode(
    state: Tensor,
    rows: Tensor,
    fractions: Tensor,
    weights: DecoderWeights,
    *,
    threads: int | None = None,
) -> Tensor:
    """What is seen at points, as `vnca.engine.reference.equations.decode` has it.

    Differentiable, once, in the state and the weights. Beyond inputs and result, memory is kept for
    nothing: the backward pass computes the hidden layers anew.

    Args:
        state: `[n + 1, C]`; the last row is the outside, always zero.
        rows: `[8, m]` rows of the state around each point, z fastest, int32; n for the outside.
        fractions: `[m, 3]` of the way from the first of these cells to the last, 0 to 1.
        weights: Of the network.
        threads: How many to use; by default one for each core.

    Raises:
        BackendUnavailableError: If the native kernel was not built.
        ShapeError: If shapes, types or rows are not as above.
    """
    result = _Decode.apply(state, rows, fractions, *weights, threads)
    assert isinstance(result, Tensor)
    return result


class _Decode(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> Tensor:
        *tensors, ctx.threads = inputs
        ctx.save_for_backward(*tensors)
        state, rows, fractions, *weights = map(array_of, tensors)
        seen = decoding.decode(
            state, rows, fractions, DecoderWeights(*weights), threads=ctx.threads
        )
        return torch.from_numpy(seen)

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        state, rows, fractions, *weights = map(array_of, ctx.saved_tensors)
        to_state, to_weights = decoding.decode_backward(
            state,
            rows,
            fractions,
            DecoderWeights(*weights),
            array_of(grad_outputs[0]),
            threads=ctx.threads,
        )
        return torch.from_numpy(to_state), None, None, *map(torch.from_numpy, to_weights), None
