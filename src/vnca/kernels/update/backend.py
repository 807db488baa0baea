"""Which implementation of a step runs: the fastest that is there, or the one asked for by name."""

import importlib.util
import sys
from collections.abc import Callable
from functools import cache, partial
from typing import Any, Literal

from vnca.errors import BackendUnavailableError, OptionError
from vnca.kernels.update import native
from vnca.typing import FloatArray

Backend = Literal["native", "reference"]


def choose(backend: str = "auto", *, device: str = "cpu") -> Backend:
    """The backend to run; says once on stderr if `auto` has to settle for a slow one.

    Args:
        backend: `auto`, `native` or `reference`.
        device: Kind of device that holds the state, as torch names it.

    Raises:
        BackendUnavailableError: If the backend asked for, or any at all, cannot run here.
        OptionError: If there is no backend of that name.
    """
    reasons = {"native": _native_unavailable(device), "reference": _reference_unavailable()}
    if backend == "auto":
        if reasons["native"] is None:
            return "native"
        if reasons["reference"] is None:
            _say_once(f"vnca: running the slow reference step: {reasons['native']}")
            return "reference"
        raise BackendUnavailableError(
            f"no backend can run the update step: native: {reasons['native']}; "
            f"reference: {reasons['reference']}"
        )
    if backend not in reasons:
        raise OptionError(f"backend: expected auto, {' or '.join(reasons)}, got {backend}")
    reason = reasons[backend]
    if reason is not None:
        raise BackendUnavailableError(f"backend {backend} cannot run: {reason}")
    return "native" if backend == "native" else "reference"


def torch_step(
    backend: str = "auto", *, device: str = "cpu", threads: int | None = None
) -> Callable[..., Any]:
    """The differentiable step on tensors, called as `vnca.kernels.update.reference.update` is.

    `threads` counts for the native kernel only; the reference uses as many as torch does.
    """
    if choose(backend, device=device) == "native":
        from vnca.kernels.update.native_autograd import update

        return partial(update, threads=threads)
    from vnca.kernels.update.reference import update

    return update


def array_step(backend: str = "auto", *, threads: int | None = None) -> Callable[..., FloatArray]:
    """The step on arrays, called as `vnca.kernels.update.native.forward` is, up to `stencil`.

    Of the backends only the reference uses torch, and as many threads as torch does.
    """
    if choose(backend) == "native":
        return partial(native.forward, threads=threads)
    from vnca.kernels.update.reference import update_arrays

    return update_arrays


def _native_unavailable(device: str) -> str | None:
    if device != "cpu":
        return f"the native kernel works on the CPU, not on {device}"
    return native.unavailable()


def _reference_unavailable() -> str | None:
    if importlib.util.find_spec("torch") is None:
        return "it needs torch; install vnca[train]"
    return None


@cache
def _say_once(line: str) -> None:
    print(line, file=sys.stderr)
