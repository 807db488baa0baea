"""Which backend runs, what a user hears about it, and that a session is the same on all."""

from typing import Any

import numpy as np
import pytest
import torch

from vnca import engine as sessions
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine import BACKENDS, Compute, backend_named, choose, native, open_session, reference
from vnca.engine import triton as triton_backend
from vnca.engine.automaton import Automaton, Weights, changing_rows, stencil
from vnca.engine.domain import Domain
from vnca.engine.triton import step as triton

needs_native = pytest.mark.skipif(native.unavailable() is not None, reason="not built")


@pytest.fixture
def no_native(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "_native", None)
    monkeypatch.setattr(native, "_reason", "no compiler", raising=False)
    sessions.say_once.cache_clear()


@pytest.fixture
def no_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (reference, triton_backend):
        monkeypatch.setattr(module.importlib.util, "find_spec", lambda _: None)


@needs_native
@pytest.mark.usefixtures("no_torch")
def test_auto_is_native_and_quiet_even_without_torch(capsys: pytest.CaptureFixture[str]) -> None:
    assert choose(Compute()).name == choose(Compute("native")).name == "native"
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("no_native")
def test_auto_says_once_what_slow_backend_it_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert [choose(Compute()).name, choose(Compute()).name] == ["numpy", "numpy"]
    assert choose(Compute(), differentiable=True).name == "reference"
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert "slow numpy step: its extension was not built" in told[0]
    assert "slow reference step" in told[1]


@pytest.mark.usefixtures("no_native")
def test_a_backend_asked_for_by_name_is_not_replaced() -> None:
    with pytest.raises(BackendUnavailableError, match="native cannot run: its extension"):
        choose(Compute("native"))
    with pytest.raises(BackendUnavailableError, match="extension was not built"):
        native.forward(*[np.zeros(0, np.float32)] * 8)  # pyright: ignore[reportArgumentType]


@pytest.mark.usefixtures("no_native", "no_torch")
def test_without_a_compiler_and_torch_painting_runs_and_training_says_what_is_missing() -> None:
    assert choose(Compute()).name == "numpy"
    with pytest.raises(BackendUnavailableError, match=r"no backend can run.*vnca\[train\]"):
        choose(Compute(), differentiable=True)
    with pytest.raises(BackendUnavailableError, match=r"triton cannot run: .*vnca\[train\]"):
        choose(Compute("triton", "cuda"))


@pytest.mark.parametrize("differentiable", [True, False])
def test_bfloat16_is_computed_as_asked_or_not_at_all(
    monkeypatch: pytest.MonkeyPatch, differentiable: bool
) -> None:
    with pytest.raises(BackendUnavailableError, match="only native has bfloat16"):
        choose(Compute("reference", precision="bfloat16"), differentiable=differentiable)
    with pytest.raises(OptionError, match="not float32, bfloat16, float16"):
        Compute(precision="half")

    class WithoutBfloat16:
        def instructions(self, bfloat16: bool) -> list[str]:
            return [] if bfloat16 else ["portable"]

    monkeypatch.setattr(native, "_native", WithoutBfloat16())
    with pytest.raises(BackendUnavailableError, match=r"native cannot run.* AVX512_BF16"):
        choose(Compute("native", precision="bfloat16"), differentiable=differentiable)
    assert choose(Compute("native"), differentiable=differentiable).name == "native"


def test_unknown_backends_and_devices_are_refused() -> None:
    with pytest.raises(OptionError, match="auto, native, triton, wgsl, numpy, reference"):
        choose(Compute("fast"))
    with pytest.raises(BackendUnavailableError, match="on the CPU, not on cuda"):
        choose(Compute("native", "cuda"))
    with pytest.raises(BackendUnavailableError, match="numpy cannot run: it has no gradients"):
        choose(Compute("numpy"), differentiable=True)


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(triton, "unavailable", lambda device: None)
    sessions.say_once.cache_clear()


@pytest.mark.usefixtures("gpu")
def test_auto_takes_triton_on_a_gpu_and_says_so_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert [choose(Compute(device="cuda:1")).name, choose(Compute(device="cuda")).name] == [
        "triton",
        "triton",
    ]
    assert capsys.readouterr().err == "vnca: running the triton step on cuda\n"


@pytest.mark.parametrize(
    ("broken", "device", "reason"),
    [
        ({"_missing": "No module named 'triton'"}, "cuda", "package triton is not installed"),
        ({"_missing": None, "_interpreted": False}, "cpu", "on NVIDIA GPUs, not on cpu"),
        (
            {"_missing": None, "_interpreted": False},
            "cuda",
            "finds no usable GPU|built without CUDA",
        ),
    ],
)
def test_triton_asked_for_where_it_cannot_run_says_why(
    broken: dict[str, object], device: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in broken.items():
        monkeypatch.setattr(triton, name, value, raising=False)
    monkeypatch.setattr(triton.torch.cuda, "is_available", lambda: False)
    with pytest.raises(BackendUnavailableError, match=f"triton cannot run: .*({reason})"):
        choose(Compute("triton", device))


@pytest.fixture(scope="module")
def automaton() -> tuple[Automaton, Domain, Any, Any]:
    """Random weights on cells of which some are missing, conditioning, and a state."""
    random = np.random.default_rng(0)
    domain = Domain.from_mask(random.random((5, 6, 7)) < 0.7, (-3, 0, 5))

    def drawn(*shape: int) -> Any:
        return (0.2 * random.standard_normal(shape)).astype(np.float32)

    weights = Weights(drawn(16, 5 * 6 + 7), drawn(16), drawn(6, 16))
    state = drawn(len(domain) + 1, 6)
    state[-1] = 0
    automaton = Automaton(weights, stencil(sobel_divisor=8), 0.5, seed=3)
    return automaton, domain, drawn(len(domain), 7), state


def runs(name: str, *, differentiable: bool) -> bool:
    chosen = backend_named(name).unavailable(Compute(name), differentiable=differentiable)
    return chosen is None


@pytest.mark.parametrize("differentiable", [False, True])
@pytest.mark.parametrize("name", BACKENDS)
def test_a_session_steps_alike_on_every_backend(
    automaton: tuple[Automaton, Domain, Any, Any], name: str, differentiable: bool
) -> None:
    if not runs(name, differentiable=differentiable):
        pytest.skip(f"{name} does not run here so")
    rule, domain, conditioning, state = automaton
    results = []
    for one, gradients in (("reference", True), (name, differentiable)):
        session = open_session(rule, domain, conditioning, Compute(one), differentiable=gradients)
        results += [
            given.read(given.run(given.upload(state), range(4, 8)))
            for given in (session, session.conditioned(2 * conditioning))
        ]
    np.testing.assert_allclose(results[2], results[0], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(results[3], results[1], rtol=1e-4, atol=1e-5)
    assert not np.allclose(results[0], results[1], atol=1e-3)


@pytest.mark.parametrize("name", BACKENDS)
def test_a_steered_session_steps_alike_on_every_backend_that_steers(
    automaton: tuple[Automaton, Domain, Any, Any], name: str
) -> None:
    rule, domain, conditioning, state = automaton
    steering = np.random.default_rng(1).standard_normal((len(domain), 3, 3)).astype(np.float32)
    if not backend_named(name).steers:
        with pytest.raises(BackendUnavailableError, match=f"{name} cannot run: it cannot steer"):
            open_session(rule, domain, conditioning, Compute(name), steered=True)
        return
    results = []
    for one, gradients in (("reference", True), (name, False)):
        compute = Compute(one)
        plain = open_session(rule, domain, conditioning, compute, differentiable=gradients)
        opened = open_session(
            rule, domain, conditioning, compute, differentiable=gradients, steered=True
        ).steered(steering)
        turned = opened.conditioned(2 * conditioning)
        results += [
            session.read(session.run(session.upload(state), range(4, 8)))
            for session in (opened, turned, plain)
        ]
    for ours, theirs in zip(results[3:], results[:3], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-4)
    assert not np.allclose(results[0], results[2], atol=1e-3)


@pytest.mark.parametrize("name", BACKENDS)
def test_gradients_of_a_session_reach_state_and_weights(
    automaton: tuple[Automaton, Domain, Any, Any], name: str
) -> None:
    if not runs(name, differentiable=True):
        pytest.skip(f"{name} has no gradients here")
    rule, domain, conditioning, state = automaton
    found = []
    for one in ("reference", name):
        weights = Weights(*(torch.tensor(w, requires_grad=True) for w in rule.weights))
        trained = Automaton(weights, rule.stencil, rule.update_probability, rule.seed)
        session = open_session(trained, domain, conditioning, Compute(one), differentiable=True)
        start = session.upload(state).clone().requires_grad_()
        session.run(start, range(3)).square().sum().backward()
        found.append([start.grad, *(w.grad for w in weights)])
    for ours, theirs in zip(found[1], found[0], strict=True):
        assert theirs.abs().max() > 0
        torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("probability", [0.25, 0.5, 1.0])
def test_every_backend_draws_the_same_mask(
    automaton: tuple[Automaton, Domain, Any, Any], probability: float
) -> None:
    _, domain, _, _ = automaton
    bits = domain.hashes.view(np.int32)
    for step in (0, 7, 2**31):
        asked: dict[str, Any] = {"seed": -5, "step": step, "probability": probability}
        expected = changing_rows(domain.hashes, **asked)
        drawn = torch.from_numpy(bits)
        from vnca.engine.tensors import changing_rows as on_tensors

        np.testing.assert_array_equal(on_tensors(drawn, **asked).numpy(), expected)
        if native.unavailable() is None:
            np.testing.assert_array_equal(native.changing_rows(bits, **asked), expected)


def test_each_step_of_a_run_is_watched(automaton: tuple[Automaton, Domain, Any, Any]) -> None:
    rule, domain, conditioning, state = automaton
    session = open_session(rule, domain, conditioning)
    seen: list[int] = []
    session.run(session.upload(state), range(5), lambda: seen.append(1))
    assert len(seen) == 5
