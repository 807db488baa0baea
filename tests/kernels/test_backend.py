"""Which backend runs, and what a user hears about it."""

import numpy as np
import pytest

from vnca.automaton.domain import Domain
from vnca.automaton.rule import Rule, RuleConfig, Scales
from vnca.automaton.stepper import stepper
from vnca.errors import BackendUnavailableError, OptionError
from vnca.kernels.update import backend, native
from vnca.kernels.update.backend import choose, torch_step

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
def test_a_machine_without_any_backend_is_told_both_reasons() -> None:
    with pytest.raises(BackendUnavailableError, match=r"not built.*needs torch"):
        choose()


def test_unknown_backends_and_devices_are_refused() -> None:
    with pytest.raises(OptionError, match="auto, native or reference, got fast"):
        choose("fast")
    with pytest.raises(BackendUnavailableError, match="on the CPU, not on cuda"):
        choose("native", device="cuda")
    assert torch_step("reference").__module__ == "vnca.kernels.update.reference"


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
