"""Which implementation of decoding runs."""

import pytest

from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine import array_decode, backend_named, native, torch_decode
from vnca.engine import numpy as array_reference
from vnca.engine.reference import equations as reference
from vnca.engine.triton import decode as decode_triton
from vnca.engine.triton import step as triton

needs_native = pytest.mark.skipif(native.unavailable() is not None, reason="not built")


@needs_native
def test_auto_is_native_with_the_threads_asked_for() -> None:
    chosen = torch_decode(threads=3)
    assert chosen.func.__module__ == "vnca.engine.native.autograd"
    assert chosen.keywords == {"threads": 3}
    arrays = array_decode("native", threads=2)
    for kernel in arrays:
        assert kernel.func.__module__ == "vnca.engine.native.decoding"
        assert kernel.keywords == {"threads": 2}


def test_without_a_compiler_the_references_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "_native", None)
    monkeypatch.setattr(native, "_reason", "no compiler", raising=False)
    assert torch_decode() is torch_decode("reference") is reference.decode
    assert array_decode() == (array_reference.decode, array_reference.decode_parts)
    assert array_decode("reference") == array_decode("numpy") == array_decode()
    for choose in (torch_decode, array_decode):
        with pytest.raises(BackendUnavailableError, match="native cannot run: its extension"):
            choose("native")


def test_a_gpu_gets_triton(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(triton, "unavailable", lambda device: None)
    assert torch_decode(device="cuda") is decode_triton.decode
    for ours, auto in zip(array_decode("triton"), array_decode(), strict=True):
        assert getattr(ours, "func", ours) is getattr(auto, "func", auto)


def test_unknown_backends_are_refused() -> None:
    for choose in (torch_decode, array_decode):
        with pytest.raises(
            OptionError, match="fast: expected auto, native, triton, wgsl, numpy, reference"
        ):
            choose("fast")


def test_numpy_has_no_decoding_of_tensors() -> None:
    with pytest.raises(BackendUnavailableError, match="numpy does not decode tensors"):
        backend_named("numpy").decode()
