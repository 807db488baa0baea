"""Sessions on torch tensors, shared by the backends that step them."""

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from vnca.core.typing import FloatArray
from vnca.engine.session import Job, StepSession


def tensor_session(
    job: Job, *, draw: Callable[..., Tensor], update: Callable[..., Tensor]
) -> StepSession:
    """A session on the job's device; weights that are tensors there stay what they are."""
    place = partial(torch.as_tensor, device=job.compute.device)
    return StepSession.open(job, draw=draw, update=update, place=place, back=_array)


def _array(tensor: Tensor) -> FloatArray:
    return tensor.detach().cpu().numpy()
