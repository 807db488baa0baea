"""Devices by name, and lines that say why one cannot be had. No GPU takes part."""

import os
import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine import Compute, choose, compute_of, device, device_named, tensors
from vnca.engine.tensors import WORKSPACE, WORKSPACES, choose_device, require_equal_runs
from vnca.engine.triton import step as triton


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A machine that torch says has GPUs, which compute, or say why they do not."""

    def pretend(*, count: int = 1, problem: Exception | None = None, driver: bool = True) -> None:
        def ones(*shape: int, device: torch.device) -> Any:
            if problem is not None:
                raise problem
            return SimpleNamespace(sum=_Sum)

        monkeypatch.setattr(device, "_has_driver", lambda: driver)
        monkeypatch.setattr(torch.version, "cuda", "13.2")
        monkeypatch.setattr(torch.version, "hip", None)
        monkeypatch.setattr(torch.cuda, "is_available", lambda: count > 0)
        monkeypatch.setattr(torch.cuda, "device_count", lambda: count)
        monkeypatch.setattr(torch.cuda, "get_device_name", lambda place=None: "NVIDIA Test")
        monkeypatch.setattr(tensors, "torch", _Torch(ones))
        device.say_once.cache_clear()

    return pretend


class _Torch:
    """Torch, but for what would need a GPU."""

    def __init__(self, ones: Callable[..., Any]) -> None:
        self.ones = ones

    def __getattr__(self, name: str) -> Any:
        return getattr(torch, name)


class _Sum:
    def item(self) -> float:
        return 8.0


def test_auto_is_the_cpu_where_there_is_no_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "_has_driver", lambda: False)
    assert device_named("auto") == "cpu"
    assert choose_device("auto") == torch.device("cpu")


def test_auto_is_a_gpu_that_works(gpu: Callable[..., None]) -> None:
    gpu(count=2)
    assert device_named("auto") == "cuda"
    assert device_named("cuda:1") == "cuda:1"
    assert compute_of("auto", "auto") == Compute("auto", "cuda")


@pytest.mark.parametrize(("backend", "precision"), [("native", "float32"), ("auto", "bfloat16")])
def test_what_works_on_the_cpu_alone_takes_that(
    gpu: Callable[..., None], backend: str, precision: str
) -> None:
    gpu()
    assert compute_of(backend, "auto", precision).device == "cpu"


def test_a_gpu_that_is_not_there_is_told(gpu: Callable[..., None]) -> None:
    gpu(count=1)
    with pytest.raises(OptionError, match=r"^`device` cuda:3: torch finds 1 GPU, counted from"):
        device_named("cuda:3")


def test_a_gpu_that_this_torch_was_not_built_for_is_told(
    gpu: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    gpu(problem=RuntimeError("CUDA error: no kernel image is available\nmore\nlines"))
    line = "for CUDA 13.2 cannot compute on NVIDIA Test .CUDA error: no kernel image is available."
    with pytest.raises(OptionError, match=line):
        device_named("cuda")
    assert device_named("auto") == device_named("auto") == "cpu"
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "computing on the CPU: torch" in said[0]


def test_a_driver_too_old_for_torch_is_told(
    gpu: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_available() -> bool:
        import warnings

        warnings.warn("CUDA initialization: The NVIDIA driver is too old\nmore", stacklevel=1)
        return False

    gpu()
    monkeypatch.setattr(torch.cuda, "is_available", is_available)
    with pytest.raises(OptionError, match=r"finds no usable GPU \(CUDA init.* is too old\)"):
        device_named("cuda")


def test_a_torch_without_cuda_is_told(
    gpu: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    gpu()
    monkeypatch.setattr(torch.version, "cuda", None)
    with pytest.raises(OptionError, match="is built without CUDA; use auto or cpu"):
        device_named("cuda")


def test_on_a_machine_without_torch_auto_is_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "find_spec", lambda name: None)
    monkeypatch.setattr(device, "_has_driver", lambda: False)
    assert device_named("auto") == "cpu"
    with pytest.raises(OptionError, match="it needs torch"):
        device_named("cuda")


@pytest.mark.parametrize("name", ["mps", "mps:0", "meta", "cuda:x", "toaster", ""])
def test_what_is_no_device_of_ours_is_refused(name: str) -> None:
    with pytest.raises(OptionError, match=f"^`device` {name}: "):
        device_named(name)


def test_apples_gpus_are_no_device_of_any_kernel() -> None:
    for backend in ("native", "numpy"):
        with pytest.raises(BackendUnavailableError, match="not on mps"):
            choose(Compute(backend, "mps"))


def test_amds_gpus_are_told_to_take_the_reference(
    monkeypatch: pytest.MonkeyPatch, gpu: Callable[..., None]
) -> None:
    gpu()
    monkeypatch.setattr(torch.version, "hip", "7.0")
    monkeypatch.setattr(triton, "_interpreted", False)
    with pytest.raises(BackendUnavailableError, match="not on AMD's"):
        choose(Compute("triton", "cuda"))
    assert choose(Compute("auto", "cuda"), differentiable=True).name == "reference"


@pytest.mark.parametrize(
    ("capability", "problem", "line"),
    [
        ((7, 5), None, "NVIDIA Test has compute capability 7.5, and the Triton kernels need 8.0"),
        (
            (9, 0),
            RuntimeError("PTX was compiled\nwith"),
            r"run a kernel on this GPU \(PTX was comp",
        ),
        ((9, 0), None, "computes wrongly on this GPU"),
    ],
)
def test_a_triton_that_does_not_fit_the_machine_is_told(
    monkeypatch: pytest.MonkeyPatch,
    gpu: Callable[..., None],
    capability: tuple[int, int],
    problem: Exception | None,
    line: str,
) -> None:
    def launch(hashes: Any, **drawn: Any) -> torch.Tensor:
        if problem is not None:
            raise problem
        return torch.zeros(3, dtype=torch.int32)

    gpu()
    monkeypatch.setattr(triton, "_interpreted", False)
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda: capability)
    monkeypatch.setattr(torch.Tensor, "cuda", lambda tensor: tensor)
    monkeypatch.setattr(triton.step_kernels, "changing_rows", launch)
    triton._why_no_kernel.cache_clear()
    try:
        with pytest.raises(BackendUnavailableError, match=line):
            choose(Compute("triton", "cuda"))
    finally:
        triton._why_no_kernel.cache_clear()


def test_cublas_is_told_before_cuda_starts() -> None:
    environment = {name: value for name, value in os.environ.items() if name != WORKSPACE}
    code = f"import vnca, os, sys; print(os.environ[{WORKSPACE!r}], 'torch' in sys.modules)"
    call = [sys.executable, "-c", code]
    told = subprocess.run(call, env=environment, capture_output=True, text=True, check=True)
    assert told.stdout.split() == [WORKSPACES[0], "False"]
    own = subprocess.run(
        call, env={**environment, WORKSPACE: ":16:8"}, capture_output=True, text=True, check=True
    )
    assert own.stdout.split() == [":16:8", "False"]


def test_a_workspace_with_which_runs_differ_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    before = torch.are_deterministic_algorithms_enabled()
    monkeypatch.setenv(WORKSPACE, ":0:0")
    try:
        with pytest.raises(OptionError, match=f"^{WORKSPACE} :0:0: runs would differ"):
            require_equal_runs(torch.device("cuda"))
        require_equal_runs(torch.device("cpu"))
        assert torch.are_deterministic_algorithms_enabled()
    finally:
        torch.use_deterministic_algorithms(before)
