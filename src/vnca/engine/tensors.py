"""What the backends that step torch tensors share: devices, sessions, the mask on any of them."""

import os
import warnings
from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor
from torch.utils import deterministic

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.engine import Job, StepSession, device_named
from vnca.engine.automaton import mask_key, mask_threshold

WORKSPACE, WORKSPACES = "CUBLAS_WORKSPACE_CONFIG", (":4096:8", ":16:8")
_LOW = 0xFFFFFFFF


def tensor_session(
    job: Job, *, draw: Callable[..., Tensor], update: Callable[..., Tensor]
) -> StepSession:
    """A session on the job's device; weights that are tensors there stay what they are."""
    place = partial(torch.as_tensor, device=job.compute.device)
    return StepSession.open(job, draw=draw, update=update, place=place, back=_array)


def count_gpus() -> int:
    """How many GPUs torch finds."""
    return torch.cuda.device_count()


def why_no_gpu(device: str) -> str | None:
    """Why torch cannot compute on a GPU, `cuda` or such as `cuda:1`, or nothing if it can."""
    if torch.version.cuda is None and torch.version.hip is None:
        return f"torch {torch.__version__} is built without CUDA"
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        is_there = torch.cuda.is_available()
    if not is_there:
        # Such as that the driver is too old for this torch.
        reasons = [_line(str(warning.message)) for warning in said]
        built = f"torch {torch.__version__} for {_toolkit()}"
        return f"{built} finds no usable GPU" + (f" ({reasons[0]})" if reasons else "")
    place = torch.device(device)
    count = torch.cuda.device_count()
    if (place.index or 0) >= count:
        return f"torch finds {count} GPU{'s' if count > 1 else ''}, counted from cuda:0"
    try:
        # A GPU of a generation that this torch was not built for is found, but runs no kernel.
        torch.ones(8, device=place).sum().item()
    except RuntimeError as error:
        name = torch.cuda.get_device_name(place)
        built = f"torch {torch.__version__} for {_toolkit()}"
        return f"{built} cannot compute on {name} ({_line(str(error))})"
    return None


def _toolkit() -> str:
    return f"CUDA {torch.version.cuda}" if torch.version.cuda else f"ROCm {torch.version.hip}"


def _line(text: str) -> str:
    return next(iter(text.strip().splitlines()), "no reason given")[:200]


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


def choose_device(name: str) -> torch.device:
    """The device of a name; `auto` takes a GPU where there is one that works.

    Raises:
        OptionError: If there is no such device, or torch cannot compute on it.
    """
    return torch.device(device_named(name))


def require_equal_runs(device: torch.device) -> None:
    """Have torch compute the same bits in every run, or refuse what it cannot compute so.

    Raises:
        OptionError: If the environment tells cuBLAS to compute otherwise.
    """
    workspace = os.environ.get(WORKSPACE)
    if device.type == "cuda" and workspace not in WORKSPACES:
        raise OptionError(
            f"{WORKSPACE} {workspace}: runs would differ; set it to {' or '.join(WORKSPACES)}, or "
            "not at all"
        )
    # `use_deterministic_algorithms` would import torch's compiler, which takes seconds.
    torch.set_deterministic_debug_mode("error")
    # It would fill what is about to be written, which takes a twentieth of a training.
    deterministic.fill_uninitialized_memory = False  # pyright: ignore[reportAttributeAccessIssue]
