"""What the backends that step torch tensors share: sessions, and the mask on any device."""

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from vnca.core import FloatArray
from vnca.engine import Job, StepSession
from vnca.engine.automaton import mask_key, mask_threshold

_LOW = 0xFFFFFFFF


def tensor_session(
    job: Job, *, draw: Callable[..., Tensor], update: Callable[..., Tensor]
) -> StepSession:
    """A session on the job's device; weights that are tensors there stay what they are."""
    place = partial(torch.as_tensor, device=job.compute.device)
    return StepSession.open(job, draw=draw, update=update, place=place, back=_array)


def _array(tensor: Tensor) -> FloatArray:
    return tensor.detach().cpu().numpy()


def changing_rows(hashes: Tensor, *, seed: int, step: int, probability: float) -> Tensor:
    """Rows `[m]` int32 of the cells that change, the same as `vnca.engine.automaton` draws.

    Args:
        hashes: `[n]`, the bits of `hash_cells` as int32.
        seed: Any integer; its low 32 bits count.
        step: Steps since the state was seeded.
        probability: Chance of a cell to change, in (0, 1].
    """
    if probability >= 1:
        return torch.arange(len(hashes), dtype=torch.int32, device=hashes.device)
    # Torch has no arithmetic on unsigned 32-bit integers everywhere: 64 bits hold their products.
    value = (hashes.long() & _LOW) ^ int(mask_key(seed, step))
    value = value ^ (value >> 16)
    value = _times(value, 0x7FEB352D)
    value = value ^ (value >> 15)
    value = _times(value, 0x846CA68B)
    value = value ^ (value >> 16)
    return (value < int(mask_threshold(probability))).nonzero().squeeze(1).int()


def _times(value: Tensor, factor: int) -> Tensor:
    """The low 32 bits of a product; in two parts, so that neither overflows."""
    low = (value & 0xFFFF) * factor
    high = (value >> 16) * factor
    return (low + ((high & 0xFFFF) << 16)) & _LOW
