"""Which implementation of decoding runs."""

import pytest

from vnca.errors import BackendUnavailableError, OptionError
from vnca.kernels.decode import array_reference, reference
from vnca.kernels.decode import triton as decode_triton
from vnca.kernels.decode.backend import array_decode, torch_decode
from vnca.kernels.update import native, triton

needs_native = pytest.mark.skipif(native.unavailable() is not None, reason="not built")


@needs_native
def test_auto_is_native_with_the_threads_asked_for() -> None:
    chosen = torch_decode(threads=3)
    assert chosen.func.__module__ == "vnca.kernels.decode.native_autograd"
    assert chosen.keywords == {"threads": 3}
    arrays = array_decode("native", threads=2)
    for kernel in arrays:
        assert kernel.func.__module__ == "vnca.kernels.decode.native"
        assert kernel.keywords == {"threads": 2}


def test_without_a_compiler_the_references_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "_native", None)
    monkeypatch.setattr(native, "_reason", "no compiler", raising=False)
    assert torch_decode() is torch_decode("reference") is reference.decode
    assert array_decode() == (array_reference.decode, array_reference.decode_cells)
    for choose in (torch_decode, array_decode):
        with pytest.raises(BackendUnavailableError, match="native cannot run: its extension"):
            choose("native")


def test_a_gpu_gets_triton(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(triton, "unavailable", lambda device: None)
    assert torch_decode(device="cuda") is decode_triton.decode
    with pytest.raises(BackendUnavailableError, match="not on arrays"):
        array_decode("triton")


def test_unknown_backends_are_refused() -> None:
    for choose in (torch_decode, array_decode):
        with pytest.raises(OptionError, match="expected auto, native, triton, reference, got fast"):
            choose("fast")
