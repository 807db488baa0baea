"""Which implementation of decoding runs: what is chosen for the step, as they come together."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from vnca.core.typing import FloatArray
from vnca.engine.session import Compute, choose


def torch_decode(
    backend: str = "auto", *, device: str = "cpu", threads: int | None = None
) -> Callable[..., Any]:
    """Differentiable decoding of tensors, called as `vnca.engine.reference.decode.decode` is.

    Args:
        backend: `auto`, `native`, `triton` or `reference`.
        device: Kind of device that holds the state, as torch names it.
        threads: How many the native kernel uses; the reference uses as many as torch does.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here.
        OptionError: If there is no backend of that name.
    """
    chosen = choose(Compute(backend, device), differentiable=True).name
    if chosen == "native":
        from vnca.engine.native.decode_autograd import decode

        return partial(decode, threads=threads)
    if chosen == "triton":
        from vnca.engine.triton.decode import decode

        return decode
    from vnca.engine.reference.decode import decode

    return decode


class ArrayDecode(NamedTuple):
    """Decoding of arrays.

    Attributes:
        decode: What is seen at points, called as `vnca.engine.native.decode.decode` is.
        decode_cells: What is seen in the parts of cells, called as `native.decode_cells` is.
    """

    decode: Callable[..., FloatArray]
    decode_cells: Callable[..., FloatArray]


def array_decode(backend: str = "auto", *, threads: int | None = None) -> ArrayDecode:
    """Decoding of arrays, which takes no torch; arguments and errors are those of `torch_decode`.

    Triton and the reference decode tensors only: where they compute the automaton, `auto` and numpy
    decode what was read back.
    """
    backend = {"triton": "auto", "reference": "numpy"}.get(backend, backend)
    if choose(Compute(backend)).name == "native":
        from vnca.engine.native import decode as native

        return ArrayDecode(
            partial(native.decode, threads=threads), partial(native.decode_cells, threads=threads)
        )
    from vnca.engine.numpy import decode as array_reference

    return ArrayDecode(array_reference.decode, array_reference.decode_cells)
