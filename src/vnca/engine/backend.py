"""Which implementation of a step runs: the fastest that is there, or the one asked for by name."""

import importlib.util
import sys
from collections.abc import Callable
from functools import cache, partial
from typing import Any, Literal

from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.typing import FloatArray
from vnca.engine.native import step as native
from vnca.engine.native.step import Precision

Backend = Literal["native", "triton", "reference"]


def choose(backend: str = "auto", *, device: str = "cpu") -> Backend:
    """The backend to run.

    `auto` says once on stderr what it takes if that is no fast one, or if it computes on a GPU.

    Args:
        backend: `auto`, `native`, `triton` or `reference`.
        device: Kind of device that holds the state, as torch names it.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here.
        OptionError: If there is no backend of that name.
    """
    if backend == "auto":
        fast: Backend = "native" if device == "cpu" else "triton"
        why_slow = _UNAVAILABLE[fast](device)
        if why_slow is None:
            if device != "cpu":
                _say_once(f"vnca: running the {fast} step on {device}")
            return fast
        _say_once(f"vnca: running the slow reference step: {why_slow}")
        return "reference"
    for name, unavailable in _UNAVAILABLE.items():
        if backend == name:
            reason = unavailable(device)
            if reason is not None:
                raise BackendUnavailableError(f"backend {backend} cannot run: {reason}")
            return name
    raise OptionError(f"backend: expected auto, {', '.join(_UNAVAILABLE)}, got {backend}")


def torch_step(
    backend: str = "auto",
    *,
    device: str = "cpu",
    threads: int | None = None,
    precision: Precision = "float32",
) -> Callable[..., Any]:
    """The differentiable step on tensors, called as `vnca.engine.reference.step.update` is.

    Args:
        backend: As in `choose`.
        device: As in `choose`.
        threads: How many the native kernel uses; the reference uses as many as torch does.
        precision: What the native kernel rounds the factors of its products to. The others have
            only float32: they compute in the type of the state that they are given.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here, or not so.
        OptionError: If there is no backend or precision of that name.
    """
    chosen = choose(backend, device=device)
    _check(precision, chosen)
    if chosen == "native":
        from vnca.engine.native.step_autograd import update

        return partial(update, threads=threads, precision=precision)
    if chosen == "triton":
        from vnca.engine.triton.step import update

        return update
    from vnca.engine.reference.step import update

    return update


def array_step(
    backend: str = "auto", *, threads: int | None = None, precision: Precision = "float32"
) -> Callable[..., FloatArray]:
    """The step on arrays, called as `vnca.engine.native.step.forward` is, up to `stencil`.

    None of them uses torch: the reference on arrays is written in numpy, and uses as many threads
    as that does. Triton works on tensors that stay on the GPU, not on arrays. Arguments and errors
    are those of `torch_step`.
    """
    if backend == "triton":
        raise BackendUnavailableError(
            "backend triton cannot run: it works on tensors on a GPU, not on arrays in main "
            "memory; expected auto, native or reference"
        )
    chosen = choose(backend)
    _check(precision, chosen)
    if chosen == "native":
        return partial(native.forward, threads=threads, precision=precision)
    from vnca.engine.numpy.step import update

    return update


def _check(precision: Precision, chosen: Backend) -> None:
    reason = native.unavailable(precision)
    if precision == "float32":
        return
    if chosen != "native":
        reason = "only the native kernel has it; use precision float32"
    if reason is not None:
        raise BackendUnavailableError(f"backend {chosen} cannot run with {precision}: {reason}")


def _native_unavailable(device: str) -> str | None:
    if device != "cpu":
        return f"the native kernel works on the CPU, not on {device}"
    return native.unavailable()


def _triton_unavailable(device: str) -> str | None:
    if importlib.util.find_spec("torch") is None:
        return "it needs torch; install vnca[train]"
    from vnca.engine.triton.step import unavailable

    return unavailable(device)


_UNAVAILABLE: dict[Backend, Callable[[str], str | None]] = {
    "native": _native_unavailable,
    "triton": _triton_unavailable,
    "reference": lambda device: None,
}
"""Why a backend cannot run on a kind of device, or nothing; asked only of those that are needed:
some answers take importing torch."""


@cache
def _say_once(line: str) -> None:
    print(line, file=sys.stderr)
