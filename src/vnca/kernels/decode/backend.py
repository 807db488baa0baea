"""Which implementation of decoding runs: what is chosen for the step, as they come together."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from vnca.errors import BackendUnavailableError
from vnca.kernels.update.backend import choose
from vnca.typing import FloatArray


def torch_decode(
    backend: str = "auto", *, device: str = "cpu", threads: int | None = None
) -> Callable[..., Any]:
    """Differentiable decoding of tensors, called as `vnca.kernels.decode.reference.decode` is.

    Args:
        backend: `auto`, `native`, `triton` or `reference`.
        device: Kind of device that holds the state, as torch names it.
        threads: How many the native kernel uses; the reference uses as many as torch does.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here.
        OptionError: If there is no backend of that name.
    """
    chosen = choose(backend, device=device)
    if chosen == "native":
        from vnca.kernels.decode.native_autograd import decode

        return partial(decode, threads=threads)
    if chosen == "triton":
        from vnca.kernels.decode.triton import decode

        return decode
    from vnca.kernels.decode.reference import decode

    return decode


class ArrayDecode(NamedTuple):
    """Decoding of arrays.

    Attributes:
        decode: What is seen at points, called as `vnca.kernels.decode.native.decode` is.
        decode_cells: What is seen in the parts of cells, called as `native.decode_cells` is.
    """

    decode: Callable[..., FloatArray]
    decode_cells: Callable[..., FloatArray]


def array_decode(backend: str = "auto", *, threads: int | None = None) -> ArrayDecode:
    """Decoding of arrays, which takes no torch; arguments and errors are those of `torch_decode`.

    Triton works on tensors that stay on the GPU, not on arrays.
    """
    if backend == "triton":
        raise BackendUnavailableError(
            "backend triton cannot run: it works on tensors on a GPU, not on arrays in main "
            "memory; expected auto, native or reference"
        )
    if choose(backend) == "native":
        from vnca.kernels.decode import native

        return ArrayDecode(
            partial(native.decode, threads=threads), partial(native.decode_cells, threads=threads)
        )
    from vnca.kernels.decode import array_reference

    return ArrayDecode(array_reference.decode, array_reference.decode_cells)
