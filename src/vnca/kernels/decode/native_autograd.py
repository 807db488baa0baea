"""Native decoding in torch's automatic differentiation; float32 on the CPU."""

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from vnca.kernels.decode import native
from vnca.kernels.decode.weights import Weights
from vnca.typing import AnyArray


def decode(
    state: Tensor,
    rows: Tensor,
    fractions: Tensor,
    weights: Weights,
    *,
    threads: int | None = None,
) -> Tensor:
    """What is seen at points, as `vnca.kernels.decode.reference.decode` has it.

    Differentiable, once, in the state and the weights. Beyond inputs and result, memory is kept for
    nothing: the backward pass computes the hidden layers anew.

    Args:
        state: `[n + 1, C]`; the last row is the outside, always zero.
        rows: `[8, m]` rows of the state around each point, z fastest, int32; n where nothing lives.
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
        state, rows, fractions, *weights = map(_array, tensors)
        seen = native.decode(state, rows, fractions, Weights(*weights), threads=ctx.threads)
        return torch.from_numpy(seen)

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        state, rows, fractions, *weights = map(_array, ctx.saved_tensors)
        to_state, to_weights = native.backward(
            state, rows, fractions, Weights(*weights), _array(grad_outputs[0]), threads=ctx.threads
        )
        return torch.from_numpy(to_state), None, None, *map(torch.from_numpy, to_weights), None


def _array(tensor: Tensor) -> AnyArray:
    return tensor.detach().contiguous().numpy()
