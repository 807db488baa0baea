"""Which backend runs, and what a user hears about it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine import backend
from vnca.engine.backend import array_step, choose, torch_step
from vnca.engine.domain import Domain
from vnca.engine.native import step as native
from vnca.engine.triton import step as triton
from vnca.rule.rule import Rule, RuleConfig, Scales
from vnca.rule.stepper import stepper

needs_native = pytest.mark.skipif(native.unavailable() is not None, reason="not built")


@pytest.fixture
def no_native(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "_native", None)
    monkeypatch.setattr(native, "_reason", "no compiler", raising=False)
    backend._say_once.cache_clear()


@pytest.fixture
def no_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend.importlib.util, "find_spec", lambda _: None)


@needs_native
@pytest.mark.usefixtures("no_torch")
def test_auto_is_native_and_quiet_even_without_torch(capsys: pytest.CaptureFixture[str]) -> None:
    assert choose() == choose("native") == "native"
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("no_native")
def test_auto_says_once_that_it_runs_the_reference(capsys: pytest.CaptureFixture[str]) -> None:
    assert [choose(), choose()] == ["reference", "reference"]
    assert capsys.readouterr().err.count("reference step: its extension was not built") == 1


@pytest.mark.usefixtures("no_native")
def test_a_backend_asked_for_by_name_is_not_replaced() -> None:
    with pytest.raises(BackendUnavailableError, match="native cannot run: its extension"):
        choose("native")
    with pytest.raises(BackendUnavailableError, match="extension was not built"):
        native.forward(*[np.zeros(0, np.float32)] * 8)  # pyright: ignore[reportArgumentType]


@pytest.mark.usefixtures("no_native", "no_torch")
def test_arrays_are_stepped_even_without_a_compiler_and_torch() -> None:
    assert array_step().__module__ == "vnca.engine.numpy.step"
    with pytest.raises(BackendUnavailableError, match=r"triton cannot run: .*vnca\[train\]"):
        choose("triton", device="cuda")


@pytest.mark.parametrize("step", [array_step, torch_step])
def test_bfloat16_is_computed_as_asked_or_not_at_all(
    step: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BackendUnavailableError, match="reference cannot run with bfloat16"):
        step("reference", precision="bfloat16")
    with pytest.raises(OptionError, match="expected float32 or bfloat16, got half"):
        step(precision="half")

    class WithoutBfloat16:
        def instructions(self, bfloat16: bool) -> list[str]:
            return [] if bfloat16 else ["portable"]

    monkeypatch.setattr(native, "_native", WithoutBfloat16())
    with pytest.raises(BackendUnavailableError, match=r"native cannot run .* AVX512_BF16"):
        step("native", precision="bfloat16")
    assert step("native").keywords["precision"] == "float32"


def test_unknown_backends_and_devices_are_refused() -> None:
    with pytest.raises(OptionError, match="auto, native, triton, reference, got fast"):
        choose("fast")
    with pytest.raises(BackendUnavailableError, match="on the CPU, not on cuda"):
        choose("native", device="cuda")
    assert torch_step("reference").__module__ == "vnca.engine.reference.step"


@needs_native
def test_a_rule_steps_alike_on_both_backends_and_with_its_own_divisors() -> None:
    rule = Rule.initial(RuleConfig(hidden=8, sobel_divisor=7.0), Scales(), seed=0)
    rule.output[:] = np.random.default_rng(1).standard_normal(rule.output.shape)
    domain = Domain.from_mask(np.ones((4, 5, 6), bool), (0, 0, 0))
    state = np.random.default_rng(0).standard_normal(domain.seed(12).shape).astype(np.float32)
    rows = np.arange(0, len(domain), 3, dtype=np.int32)
    priors = np.ones((len(domain), 7), np.float32)
    native_state, reference_state = (
        stepper(rule, name)(state, rows, domain.neighbours, priors)
        for name in ("native", "reference")
    )
    np.testing.assert_allclose(native_state, reference_state, rtol=1e-4, atol=1e-4)


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(triton, "unavailable", lambda device: None)
    backend._say_once.cache_clear()


@pytest.mark.usefixtures("gpu")
def test_auto_takes_triton_on_a_gpu_and_says_so_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert [choose(device="cuda"), choose(device="cuda")] == ["triton", "triton"]
    assert capsys.readouterr().err == "vnca: running the triton step on cuda\n"
    assert torch_step(device="cuda") is torch_step("triton", device="cuda") is triton.update


@pytest.mark.parametrize(
    ("broken", "device", "reason"),
    [
        ({"_missing": "No module named 'triton'"}, "cuda", "package triton is not installed"),
        ({"_missing": None, "_interpreted": False}, "cpu", "on NVIDIA GPUs, not on cpu"),
        ({"_missing": None, "_interpreted": False}, "cuda", "torch finds no NVIDIA GPU"),
    ],
)
def test_triton_asked_for_where_it_cannot_run_says_why(
    broken: dict[str, object], device: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in broken.items():
        monkeypatch.setattr(triton, name, value, raising=False)
    monkeypatch.setattr(triton.torch.cuda, "is_available", lambda: False)
    with pytest.raises(BackendUnavailableError, match=f"triton cannot run: .*{reason}"):
        torch_step("triton", device=device)


def test_arrays_are_not_sent_to_a_gpu_one_step_at_a_time() -> None:
    with pytest.raises(BackendUnavailableError, match=r"triton cannot run: .* not on arrays"):
        array_step("triton")
