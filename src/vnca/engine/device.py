"""Devices by name, and what is said once about where is computed."""

import ctypes
import re
import sys
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec

from vnca.core.errors import OptionError


def device_named(name: str) -> str:
    """The device of a name, as `Compute` takes it: `cpu`, `cuda` or such as `cuda:1`.

    `auto` is a GPU where torch can compute on one, else the CPU; why it is the CPU although there
    is a driver for NVIDIA's GPUs is said once on stderr.

    Raises:
        OptionError: If there is no such device, or torch cannot compute on it.
    """
    if name == "cpu":
        return name
    if name.partition(":")[0] == "mps":
        raise OptionError(
            f"`device` {name}: there are no kernels for Apple's GPUs; the native one works on the "
            "CPU of a Mac: use cpu"
        )
    if not re.fullmatch(r"auto|cuda(:\d{1,3})?", name):
        raise OptionError(f"`device` {name}: expected auto, cpu, cuda, or such as cuda:1")
    if find_spec("torch") is None:
        reason = "it needs torch; install vnca[train]"
    elif name == "auto" and not _has_driver():
        return "cpu"
    else:
        # Torch takes seconds to import: only where there may be a GPU.
        reason = import_module("vnca.engine.tensors").why_no_gpu(name.replace("auto", "cuda"))
    if reason is None:
        return name.replace("auto", "cuda")
    if name != "auto":
        raise OptionError(f"`device` {name}: {reason}; use auto or cpu")
    if _has_driver():
        say_once(f"vnca: computing on the CPU: {reason}")
    return "cpu"


def shared_device(device: str, rank: int) -> str:
    """The GPU of one of several programs on a machine, each its own as far as there are enough.

    Args:
        device: As of `device_named`; cpu, or a GPU by its number, stays.
        rank: Number of the program on its machine.
    """
    if device != "cuda":
        return device
    count = import_module("vnca.engine.tensors").count_gpus()
    return f"cuda:{rank % max(1, count)}"


def _has_driver() -> bool:
    """Whether a driver is installed without which torch finds no GPU."""
    for library in ("libcuda.so.1", "nvcuda.dll", "libamdhip64.so"):
        with suppress(OSError):
            ctypes.CDLL(library)
            return True
    return False


@cache
def say_once(line: str) -> None:
    """Print a line to stderr, unless it was printed before."""
    print(line, file=sys.stderr)
