"""The shaders against the readable backends: on Mesa's lavapipe, where no GPU is."""

import os
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vnca.core import Box, FloatArray
from vnca.core.errors import BackendUnavailableError, OptionError, OutOfMemoryError
from vnca.core.volume import Volume
from vnca.engine import Compute, backend_named, choose, compute_of, open_session
from vnca.engine import numpy as readable
from vnca.engine.automaton import Automaton, DecoderWeights, Weights, stencil
from vnca.engine.domain import Border, Domain, subdivided
from vnca.engine.wgsl import device, session
from vnca.engine.wgsl.parts import Rows
from vnca.painting import StylizeConfig, stylize
from vnca.rule import Rule
from vnca.rule.library import load_style

MISSING = backend_named("wgsl").missing(Compute("wgsl"))


@pytest.fixture(autouse=True)
def device_is_there() -> None:
    """Skipped at home without a device; continuous integration has to have one."""
    if MISSING is not None and os.environ.get("CI"):
        pytest.fail(MISSING)
    if MISSING is not None:
        pytest.skip(MISSING)


def drawn(seed: int, *shape: int, scale: float = 0.2) -> FloatArray:
    return (scale * np.random.default_rng(seed).standard_normal(shape)).astype(np.float32)


def decoder(channels: int, units: int) -> DecoderWeights:
    """Layers that do not let rounding grow: each sine adds as many values as it has inputs."""
    shapes = DecoderWeights.shapes(channels, units)
    scales = [1.5 / shape[-1] ** 0.5 for shape in shapes]
    return DecoderWeights(
        *(drawn(2 + k, *shapes[k], scale=scale) for k, scale in enumerate(scales))
    )


def automaton(channels: int, hidden: int, told: int, probability: float) -> Automaton:
    weights = Weights(
        drawn(1, hidden, 5 * channels + told), drawn(2, hidden), drawn(3, channels, hidden)
    )
    return Automaton(weights, stencil(sobel_divisor=8), probability, seed=-5)


def after(rule: Automaton, domain: Domain, told: FloatArray, state: FloatArray, **compute: Any):
    opened = open_session(rule, domain, told, Compute(**compute))
    return opened.read(opened.run(opened.upload(state), range(4, 8)))


@pytest.mark.parametrize("border", ["replicate", "circular"])
@pytest.mark.parametrize(
    ("shape", "channels", "hidden", "told", "probability"),
    [
        ((1, 1, 1), 4, 1, 3, 1.0),
        ((5, 6, 7), 6, 17, 7, 0.5),
        ((16, 9, 20), 12, 96, 7, 0.25),
        ((17, 8, 3), 5, 8, 4, 1.0),
    ],
)
def test_steps_are_those_of_numpy(
    shape: tuple[int, int, int],
    channels: int,
    hidden: int,
    told: int,
    probability: float,
    border: Border,
) -> None:
    alive = np.random.default_rng(0).random(shape) < 0.7
    alive.flat[0] = True
    domain = Domain.from_mask(alive, (-3, 0, 5), border=border)
    rule = automaton(channels, hidden, told, probability)
    state, conditioning = drawn(4, len(domain) + 1, channels), drawn(5, len(domain), told)
    state[-1] = 0
    given = (rule, domain, conditioning, state)
    expected = after(*given, backend="numpy")
    assert not np.allclose(expected, state, atol=1e-3)
    np.testing.assert_allclose(after(*given, backend="wgsl"), expected, rtol=1e-4, atol=1e-5)
    half = backend_named("wgsl").missing(Compute("wgsl", precision="float16"))
    if half is None:
        got = after(*given, backend="wgsl", precision="float16")
        np.testing.assert_allclose(got, expected, atol=2e-2 * np.abs(expected).max())
        assert not np.array_equal(got, expected)


def test_a_domain_without_cells_stays_as_it_is() -> None:
    domain = Domain.from_mask(np.zeros((2, 2, 2), bool), (0, 0, 0))
    rule = automaton(6, 8, 7, 0.5)
    state = after(rule, domain, drawn(0, 0, 7), domain.seed(6), backend="wgsl")
    np.testing.assert_array_equal(state, np.zeros((1, 6)))


@pytest.mark.parametrize(("channels", "units"), [(4, 1), (12, 32), (5, 17), (20, 40)])
@pytest.mark.parametrize("with_weights", [True, False])
def test_what_is_seen_is_what_numpy_sees(channels: int, units: int, with_weights: bool) -> None:
    domain = Domain.from_mask(np.random.default_rng(0).random((4, 5, 6)) < 0.8, (0, 0, 0))
    state = drawn(1, len(domain) + 1, channels, scale=0.5)
    state[-1] = 0
    layers = decoder(channels, units)
    weights = layers if with_weights else None
    cells = np.arange(0, len(domain), 3, dtype=np.int32)
    decoding = backend_named("wgsl").array_decode()
    for factor in (1, 3):
        rows, fractions = subdivided(cells, domain.neighbours, factor)
        expected = readable.decode(state, rows, fractions, weights)
        got = decoding.decode(state, rows, fractions, weights)
        assert got.shape == expected.shape
        np.testing.assert_allclose(got, expected, atol=2e-5 * np.abs(expected).max())
    asked = (state, cells, domain.neighbours, 2, 2, weights, 0.5)
    shown = zip(decoding.decode_parts(*asked), readable.decode_parts(*asked), strict=True)
    for got, expected in shown:
        np.testing.assert_allclose(got, expected, atol=2e-5)
    rows, fractions = subdivided(cells[:0], domain.neighbours, 1)
    assert decoding.decode(state, rows, fractions, weights).shape == (0, 4)


def test_a_style_paints_alike(tiny_smoke: Volume) -> None:
    frames = [replace(tiny_smoke, frame=number) for number in (1, 2)]
    rule: Rule = load_style("ink").rule
    config = StylizeConfig(warmup=8, steps_per_frame=4)
    box = Box(tiny_smoke.box.lower, tiny_smoke.box.upper)
    painted = [
        list(stylize(frames, rule, config, box=box, refine=2, compute=Compute(backend)))
        for backend in ("numpy", "wgsl")
    ]
    for ours, theirs in zip(*painted, strict=True):
        np.testing.assert_allclose(ours.state.values, theirs.state.values, atol=1e-3)
        np.testing.assert_allclose(ours.colour, theirs.colour, atol=5e-3)
        np.testing.assert_allclose(ours.density, theirs.density, atol=5e-3)


def test_it_is_chosen_by_name_and_asks_torch_for_nothing() -> None:
    assert choose(compute_of("wgsl", "auto")).name == "wgsl"
    with pytest.raises(BackendUnavailableError, match="only wgsl has float16"):
        choose(Compute("numpy", precision="float16"))
    with pytest.raises(BackendUnavailableError, match="only native has bfloat16"):
        choose(Compute("wgsl", precision="bfloat16"))
    with pytest.raises(BackendUnavailableError, match="no gradients"):
        choose(Compute("wgsl"), differentiable=True)


@pytest.mark.parametrize("precision", ["float32", "float16"])
def test_what_is_bound_in_parts_is_the_same_to_the_bit(
    monkeypatch: pytest.MonkeyPatch, precision: str
) -> None:
    reason = backend_named("wgsl").missing(Compute("wgsl", precision=precision))
    if reason is not None:
        pytest.skip(reason)
    domain = Domain.from_mask(np.random.default_rng(1).random((16, 16, 16)) < 0.8, (-3, 0, 5))
    rule = automaton(12, 32, 7, 0.5)
    state, told = drawn(4, len(domain) + 1, 12), drawn(5, len(domain), 7)
    state[-1] = 0
    layers = decoder(12, 8)
    cells = np.arange(len(domain), dtype=np.int32)
    rows, fractions = subdivided(cells, domain.neighbours, 2)
    decoding = backend_named("wgsl").array_decode()

    def both() -> tuple[FloatArray, FloatArray, FloatArray]:
        opened = open_session(rule, domain, told, Compute("wgsl", precision=precision))
        uploaded = opened.upload(state)
        stepped = opened.read(opened.run(uploaded, range(4, 8)))
        again = opened.conditioned(2 * told)
        changed = again.read(again.run(uploaded, range(2)))
        return stepped, changed, decoding.decode(stepped, rows, fractions, layers)

    whole = both()
    monkeypatch.setattr(device, "binding_bytes", lambda: 20_000)
    divided = Rows.of(state)
    assert divided.layout.parts > 4
    np.testing.assert_array_equal(divided.read(np.float32), state.reshape(-1))
    for ours, theirs in zip(both(), whole, strict=True):
        assert np.abs(theirs).max() > 0.1
        np.testing.assert_array_equal(ours, theirs)


def test_what_the_device_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    domain = Domain.from_mask(np.ones((24, 24, 24), bool), (0, 0, 0))
    given = (automaton(12, 8, 7, 0.5), domain, drawn(0, len(domain), 7))
    monkeypatch.setattr(device, "binding_bytes", lambda: 16_000)
    with pytest.raises(OutOfMemoryError, match=r"in \d+ parts of 0.0153 MiB, and .* binds at most"):
        open_session(*given, Compute("wgsl"))
    monkeypatch.setattr(device, "binding_bytes", lambda: 1000)
    with pytest.raises(OutOfMemoryError, match="binds at most 0 MiB"):
        device.Buffer.empty(1001)
    monkeypatch.undo()
    monkeypatch.setattr(session, "MOST_PLACES", 7)
    alive = np.zeros((17, 17, 17), bool)
    alive[0, 0, 0] = alive[16, 16, 16] = True
    with pytest.raises(OptionError, match="scattered over 24 × 24 × 24 cells"):
        open_session(
            automaton(6, 8, 7, 0.5),
            Domain.from_mask(alive, (0, 0, 0)),
            drawn(0, 2, 7),
            Compute("wgsl"),
        )
