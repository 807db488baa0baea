"""The memory that work takes at its most, beyond what was taken before it began."""

import ctypes
from collections.abc import Callable
from pathlib import Path

_SELF = Path("/proc/self")


def peak_mb(work: Callable[[], object], device: str) -> float | None:
    """Megabytes (10⁶ bytes) that a call of `work` takes; None where that cannot be known.

    On a GPU torch's allocator tells. On the CPU it is how far the resident memory of the process
    rises, as Linux records it, once all that earlier work left unused has been given back.
    """
    if device == "cpu":
        return _peak_on_cpu(work)
    import torch

    torch.cuda.synchronize()
    before = torch.cuda.memory_allocated()
    torch.cuda.reset_peak_memory_stats()
    work()
    torch.cuda.synchronize()
    return round((torch.cuda.max_memory_allocated() - before) / 1e6, 1)


def _peak_on_cpu(work: Callable[[], object]) -> float | None:
    try:
        # Else freed memory that malloc holds on to would be used again unseen.
        ctypes.CDLL(None).malloc_trim(0)
        (_SELF / "clear_refs").write_text("5")  # sets the highest mark to what is resident now
        before = _kilobytes("VmRSS")
    except (OSError, AttributeError):  # not Linux, another C library, or not allowed
        work()
        return None
    work()
    return round(max(0, _kilobytes("VmHWM") - before) * 1024 / 1e6, 1)


def _kilobytes(name: str) -> int:
    lines = (_SELF / "status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))
