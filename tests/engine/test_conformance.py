"""Every backend of the update step against the reference in float64."""

import dataclasses
import os
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from vnca.core import AnyArray, FloatArray, IntArray
from vnca.core.errors import ShapeError
from vnca.engine import PRECISIONS, Compute, backend_named, native, open_session
from vnca.engine.automaton import Automaton, Weights, changing_rows, stencil
from vnca.engine.domain import Border, Domain
from vnca.engine.native.autograd import update as native_update
from vnca.engine.reference import equations as reference
from vnca.engine.triton import step as triton_backend

KERNELS: dict[str, dict[str, Any]] = {
    name: {"precision": precision, "instructions": name}
    for precision in PRECISIONS
    if native.unavailable(precision) is None
    for name in native.instructions(precision)
}
needs_native = pytest.mark.skipif(not KERNELS, reason="the native kernel was not built")
needs_bfloat16 = pytest.mark.skipif(
    native.unavailable("bfloat16") is not None, reason=str(native.unavailable("bfloat16"))
)

# The Triton kernels run on the GPU if there is one, else in Triton's interpreter.
GPU = torch.cuda.is_available()
DEVICE = "cuda" if GPU else "cpu"
needs_triton = pytest.mark.skipif(
    triton_backend.unavailable(DEVICE) is not None, reason=str(triton_backend.unavailable(DEVICE))
)
needs_gpu = pytest.mark.skipif(not GPU, reason="not interpreted: bfloat16, tensor cores")
triton_update = partial(triton_backend.update, precision="ieee")

WGSL = backend_named("wgsl").missing(Compute("wgsl"))
SEED, STEP = 0, 1


@dataclasses.dataclass(frozen=True)
class Problem:
    """The arguments of a step, and a gradient of its result."""

    state: FloatArray
    rows: IntArray
    neighbours: IntArray
    priors: FloatArray
    hidden: FloatArray
    bias: FloatArray
    output: FloatArray
    stencil: FloatArray
    gradient: FloatArray
    steering: FloatArray | None
    domain: Domain

    def with_(self, **changes: AnyArray) -> "Problem":
        return dataclasses.replace(self, **changes)

    def forward(self, **options: object) -> FloatArray:
        return native.forward(*self._arrays[:-2], self.steering, **options)  # pyright: ignore

    def backward(self, **options: object) -> tuple[FloatArray, ...]:
        return native.backward(*self._arrays, **options)  # pyright: ignore

    @property
    def _arrays(self) -> tuple[AnyArray, ...]:
        return tuple(getattr(self, field.name) for field in dataclasses.fields(self)[:-1])


def problem(
    shape: tuple[int, int, int] = (7, 9, 11),
    *,
    channels: int = 12,
    hidden: int = 32,
    priors: int = 7,
    occupancy: float = 1.0,
    probability: float = 0.5,
    border: Border = "replicate",
    steered: bool = False,
) -> Problem:
    random = np.random.default_rng(4)

    def draw(*lengths: int, scale: float = 1.0) -> FloatArray:
        return (scale * random.standard_normal(lengths)).astype(np.float32)

    domain = Domain.from_mask(random.random(shape) < occupancy, (-3, 0, 5), border=border)
    n = len(domain)
    state = draw(n + 1, channels)
    state[-1] = 0
    return Problem(
        state,
        changing_rows(domain.hashes, seed=SEED, step=STEP, probability=probability),
        domain.neighbours,
        draw(n, priors),
        draw(hidden, 5 * channels + priors, scale=0.1),
        draw(hidden, scale=0.1),
        draw(channels, hidden, scale=0.1),
        stencil(sobel_divisor=30.0),
        draw(n + 1, channels),
        draw(n, 3, 3) if steered else None,
        domain,
    )


Update = Callable[..., Tensor]


def run(update: Update, p: Problem, dtype: torch.dtype, device: str = "cpu") -> dict[str, AnyArray]:
    """The new state and the gradients."""

    def tensor(array: AnyArray, *, trained: bool = False) -> Tensor:
        return torch.tensor(array, dtype=dtype, device=device, requires_grad=trained)

    state = tensor(p.state, trained=True)
    weights = Weights(*(tensor(w, trained=True) for w in (p.hidden, p.bias, p.output)))
    result = update(
        state,
        torch.tensor(p.rows, device=device),
        torch.tensor(p.neighbours, device=device),
        tensor(p.priors),
        weights,
        torch.tensor(p.stencil, dtype=torch.promote_types(dtype, torch.float32), device=device),
        **({} if p.steering is None else {"steering": tensor(p.steering)}),
    )
    gradients = torch.autograd.grad(result, (state, *weights), tensor(p.gradient))
    names = ("state", "to_state", "to_hidden", "to_bias", "to_output")
    arrays = (
        t.detach().to(torch.promote_types(dtype, torch.float32)) for t in (result, *gradients)
    )
    return dict(zip(names, (t.numpy(force=True) for t in arrays), strict=True))


def assert_conforms(
    got: dict[str, AnyArray], expected: dict[str, AnyArray], *, atol: float = 3e-6
) -> None:
    for name, exact in expected.items():
        scale = np.abs(exact).max(initial=1e-30)
        np.testing.assert_allclose(got[name] / scale, exact / scale, atol=atol, err_msg=name)


def assert_close_to_bfloat16(
    got: dict[str, AnyArray], expected: dict[str, AnyArray], *, steered: bool
) -> None:
    """As exact as the README of the kernels says. Hidden units near zero turn on and off, and
    gradients with them."""
    furthest = 7e-2 if steered else 6e-2
    for name, exact in expected.items():
        error = np.linalg.norm(got[name] - exact) / max(float(np.linalg.norm(exact)), 1e-30)
        assert error <= (5e-3 if name == "state" else furthest), name


CASES = {
    "paper": {"shape": (33, 8, 65), "hidden": 128, "occupancy": 0.8},
    "default": {"shape": (16, 17, 12), "hidden": 96},
    "one cell": {"shape": (1, 1, 1), "channels": 5, "hidden": 17, "priors": 0, "probability": 1},
    "one row of cells": {"shape": (1, 1, 65), "channels": 1, "hidden": 1, "priors": 1},
    "odd": {"channels": 5, "hidden": 17, "priors": 3, "occupancy": 0.4},
    "every cell changes": {"probability": 1, "hidden": 64},
    "no cell changes": {"probability": 1e-9},
    "no cell": {"occupancy": 0},
    "wraps": {"shape": (9, 3, 8), "border": "circular", "occupancy": 0.7},
    "wraps onto itself": {"shape": (2, 1, 3), "border": "circular", "probability": 1},
    "wide": {"shape": (5, 6, 7), "channels": 64, "hidden": 512, "priors": 16},
    "many channels": {"channels": 20, "hidden": 100, "priors": 2},
    "single brick": {"shape": (8, 8, 8), "hidden": 32},
    "all bricks": {"shape": (16, 8, 16), "hidden": 16},
    "7×9×11": {"shape": (7, 9, 11), "hidden": 96},
    "steered": {"shape": (9, 8, 33), "hidden": 32, "occupancy": 0.8, "steered": True},
    "steered, odd": {"channels": 20, "hidden": 17, "priors": 0, "steered": True},
    "steered, one cell": {"shape": (1, 1, 1), "channels": 5, "probability": 1, "steered": True},
    "steered, wraps": {"shape": (9, 3, 8), "border": "circular", "steered": True},
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("backend", ["reference", *KERNELS])
def test_a_step_and_all_its_gradients_agree_with_the_reference(case: str, backend: str) -> None:
    p = problem(**CASES[case])
    exact = run(reference.update, p, torch.float64)
    if backend == "reference":
        assert_conforms(run(reference.update, p, torch.float32), exact)
    else:
        names = ("to_state", "to_hidden", "to_bias", "to_output")
        options = KERNELS[backend]
        gradients = zip(names, p.backward(**options), strict=True)
        got = {"state": p.forward(**options), **dict(gradients)}
        if options["precision"] == "bfloat16":
            assert_close_to_bfloat16(got, exact, steered=p.steering is not None)
        else:
            assert_conforms(got, exact)


# Hundreds of hidden units take minutes on a software driver; and it does not steer.
WGSL_CASES = {name: CASES[name] for name in CASES if not name.startswith(("wide", "steered"))}
WGSL_CASES["32³"] = {"shape": (32, 32, 32), "hidden": 96}


@pytest.mark.parametrize("case", WGSL_CASES)
def test_a_step_in_wgsl_agrees_with_the_reference(case: str) -> None:
    if WGSL is not None and os.environ.get("CI"):
        pytest.fail(WGSL)  # there, a device has to be
    if WGSL is not None:
        pytest.skip(WGSL)
    given = WGSL_CASES[case]
    p = problem(**given)
    weights = Weights(p.hidden, p.bias, p.output)
    rule = Automaton(weights, p.stencil, given.get("probability", 0.5), seed=SEED)
    session = open_session(rule, p.domain, p.priors, Compute("wgsl"))
    got = session.read(session.step(session.upload(p.state), STEP))
    exact = run(reference.update, p, torch.float64)
    assert_conforms({"state": got}, {"state": exact["state"]})


def joined(first: Problem, second: Problem) -> Problem:
    """Two grids that do not touch, in one list: a batch."""
    n, m = len(first.priors), len(second.priors)
    outside = n + m
    moved = second.neighbours + n  # what was m, nothing, becomes n + m by itself
    kept = np.where(first.neighbours == n, outside, first.neighbours)
    return first.with_(
        state=np.concatenate([first.state[:-1], second.state]),
        rows=np.concatenate([first.rows, second.rows + n]).astype(np.int32),
        neighbours=np.concatenate([kept, moved], axis=1).astype(np.int32),
        priors=np.concatenate([first.priors, second.priors]),
        gradient=np.concatenate([first.gradient[:-1], second.gradient]),
    )


@pytest.mark.parametrize("backend", ["reference", *KERNELS])
def test_grids_in_one_batch_change_as_each_does_alone(backend: str) -> None:
    alone = [problem((7, 9, 11), occupancy=0.6), problem((33, 4, 5))]
    alone[1] = alone[1].with_(hidden=alone[0].hidden, bias=alone[0].bias, output=alone[0].output)
    batch, n = joined(*alone), len(alone[0].priors)
    if backend == "reference":
        got, each = (
            [run(reference.update, p, torch.float32) for p in ps] for ps in ([batch], alone)
        )
        state, to_state, *to_weights = got[0].values()
        parts = [[*values.values()] for values in each]
    else:
        options = KERNELS[backend]
        state, (to_state, *to_weights) = batch.forward(**options), batch.backward(**options)
        parts = [[p.forward(**options), *p.backward(**options)] for p in alone]
    np.testing.assert_array_equal(state, np.concatenate([parts[0][0][:-1], parts[1][0]]))
    for got_part, exact in ((to_state[:n], parts[0][1][:-1]), (to_state[n:], parts[1][1])):
        np.testing.assert_allclose(got_part, exact, atol=1e-4 * np.abs(exact).max())
    for together, one, other in zip(to_weights, parts[0][2:], parts[1][2:], strict=True):
        np.testing.assert_allclose(together, one + other, atol=1e-4 * np.abs(together).max())


TRITON_CASES = {
    "several portions of hidden units": {"shape": (3, 4, 3), "hidden": 300, "priors": 16},
    "channels of two widths": {"shape": (3, 3, 5), "channels": 20, "hidden": 24, "priors": 2},
    "flat": {"shape": (5, 1, 6), "occupancy": 0.7, "probability": 1},
    "no row": {"shape": (2, 3, 2), "probability": 1e-9},
}
QUICK = ("one cell", "one row of cells", "no cell", "wraps", "wraps onto itself")
"""Cases that take Triton's interpreter about a second, or less."""
TRITON_CASES |= {name: CASES[name] for name in (CASES if GPU else QUICK)}
TRITON_CASES = {name: case for name, case in TRITON_CASES.items() if "steered" not in case}


@needs_triton
@pytest.mark.parametrize("case", TRITON_CASES)
def test_the_triton_step_and_all_its_gradients_agree_with_the_reference(case: str) -> None:
    p = problem(**TRITON_CASES[case])
    got = run(triton_update, p, torch.float32, DEVICE)
    assert_conforms(got, run(reference.update, p, torch.float64))


@needs_triton
@pytest.mark.parametrize(
    ("dtype", "atol", "cosine"),
    [
        (torch.float16, 2e-3, 0.999999),
        pytest.param(torch.bfloat16, 0.03, 0.999, marks=needs_gpu),
    ],
)
def test_the_triton_step_keeps_its_tolerance_with_short_numbers(
    dtype: torch.dtype, atol: float, cosine: float
) -> None:
    p = problem((4, 5, 6), occupancy=0.8)
    rounded = {
        field.name: torch.tensor(getattr(p, field.name)).to(dtype).float().numpy()
        for field in dataclasses.fields(p)
        if field.name not in ("rows", "neighbours", "stencil", "steering", "domain")
    }
    p = p.with_(**rounded)
    got = run(triton_update, p, dtype, DEVICE)
    expected = run(reference.update, p, torch.float64)
    assert_conforms(got, expected, atol=atol)
    for name, exact in expected.items():
        alike = (got[name] * exact).sum() / np.linalg.norm(got[name]) / np.linalg.norm(exact)
        assert alike > cosine, name


@needs_gpu
@needs_triton
@pytest.mark.parametrize(("precision", "atol"), [("tf32x3", 3e-6), ("tf32", 4e-3)])
def test_tensor_cores_keep_the_tolerance_of_their_precision(precision: str, atol: float) -> None:
    p = problem((16, 17, 12), hidden=128)
    update = partial(triton_backend.update, precision=precision)
    got = run(update, p, torch.float32, DEVICE)
    assert_conforms(got, run(reference.update, p, torch.float64), atol=atol)


@needs_triton
def test_triton_results_are_the_same_bits_in_every_run(monkeypatch: pytest.MonkeyPatch) -> None:
    p = problem((24, 17, 30) if GPU else (4, 5, 7), occupancy=0.9)
    first, second = (run(triton_update, p, torch.float32, DEVICE) for _ in range(2))
    # One program that takes all tiles in turn sums the weights' gradients in another order.
    monkeypatch.setattr(triton_backend, "PROGRAMS", 1)
    alone = run(triton_update, p, torch.float32, DEVICE)
    for name, array in first.items():
        assert array.tobytes() == second[name].tobytes(), name
    assert_conforms(alone, first)
    for name in ("state", "to_state"):
        assert alone[name].tobytes() == first[name].tobytes(), name


@needs_triton
def test_a_state_gone_wrong_stays_visible_and_local_with_triton() -> None:
    p = problem((5, 4, 4), probability=1)
    p.state[0, 3] = np.nan
    wrong = np.isnan(run(triton_update, p, torch.float32, DEVICE)["state"]).any(axis=1)
    np.testing.assert_array_equal(wrong[:-1], (p.neighbours == 0).any(axis=0))


@needs_triton
@pytest.mark.parametrize("probability", [0.5, 1 - 2.0**-40, 1.0])
def test_the_mask_drawn_by_triton_has_the_same_bits(probability: float) -> None:
    from vnca.engine.triton import step_kernels as triton_mask

    hashes = np.random.default_rng(0).integers(0, 2**32, 3000, dtype=np.uint32)
    on_device = torch.from_numpy(hashes.view(np.int32)).to(DEVICE)
    for seed, step in ((0, 0), (2**31 + 5, 7), (-3, 2**32 - 1)):
        options = {"seed": seed, "step": step, "probability": probability}
        rows = triton_mask.changing_rows(on_device, **options).numpy(force=True)
        np.testing.assert_array_equal(rows, changing_rows(hashes, **options))
        assert rows.dtype == np.int32


@needs_native
@pytest.mark.parametrize("steered", [False, True])
def test_training_gets_the_native_gradients(steered: bool) -> None:
    p = problem(occupancy=0.6, steered=steered)
    got = run(native_update, p, torch.float32)
    assert_conforms(got, run(reference.update, p, torch.float64))
    np.testing.assert_array_equal(got["to_state"], p.backward()[0])


@needs_bfloat16
def test_training_gets_the_precision_it_asked_for() -> None:
    p = problem(occupancy=0.6)
    got = run(partial(native_update, precision="bfloat16"), p, torch.float32)
    np.testing.assert_array_equal(got["state"], p.forward(precision="bfloat16"))
    np.testing.assert_array_equal(got["to_state"], p.backward(precision="bfloat16")[0])
    assert (got["state"] != p.forward()).any()


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
def test_results_are_the_same_bits_in_every_run_and_with_any_number_of_threads(
    backend: str,
) -> None:
    p = problem((24, 17, 30), occupancy=0.7)
    options = [{"threads": threads, **KERNELS[backend]} for threads in (1, 1, 2, 3, 8)]
    for results in zip(*([p.forward(**o), *p.backward(**o)] for o in options), strict=True):
        assert len({array.tobytes() for array in results}) == 1


@needs_native
def test_every_value_of_the_output_is_written() -> None:
    p = problem(occupancy=0.6, probability=0.1)
    out = np.full_like(p.state, np.nan)
    assert p.forward(out=out) is out
    np.testing.assert_array_equal(out, p.forward())
    untouched = np.setdiff1d(np.arange(len(p.state)), p.rows)
    np.testing.assert_array_equal(out[untouched], p.state[untouched])


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
@pytest.mark.parametrize(("channels", "priors"), [(12, 7), (5, 0)])
def test_a_state_gone_wrong_stays_visible_and_local(
    backend: str, channels: int, priors: int
) -> None:
    p = problem((20, 4, 4), probability=1, channels=channels, priors=priors)
    bad = p.state.copy()
    bad[0, 3] = np.nan
    wrong = np.isnan(p.with_(state=bad).forward(**KERNELS[backend])).any(axis=1)
    reached = (p.neighbours == 0).any(axis=0)
    np.testing.assert_array_equal(wrong[:-1], reached)


@needs_native
def test_arrays_in_read_only_memory_can_be_used() -> None:
    p = problem()
    expected = p.forward()
    for field in dataclasses.fields(p):
        if field.name not in ("steering", "domain"):
            getattr(p, field.name).setflags(write=False)
    np.testing.assert_array_equal(p.forward(), expected)


def neighbours_with(p: Problem, value: int) -> IntArray:
    neighbours = p.neighbours.copy()
    neighbours[5, p.rows[-1]] = value
    return neighbours


@needs_native
@pytest.mark.parametrize(
    ("said", "spoil"),
    [
        ("state", lambda p: {"state": p.state[:-1]}),
        ("state", lambda p: {"state": p.state.astype(np.float64)}),
        ("state", lambda p: {"state": np.asfortranarray(p.state)}),
        ("state", lambda p: {"state": p.state[:, 0]}),
        ("rows", lambda p: {"rows": p.rows[::-1].copy()}),
        ("rows", lambda p: {"rows": p.rows[::2]}),
        ("rows", lambda p: {"rows": p.rows.astype(np.int64)}),
        ("rows", lambda p: {"rows": np.array([4, 4], np.int32)}),
        ("rows", lambda p: {"rows": np.array([-1, 4], np.int32)}),
        ("rows", lambda p: {"rows": np.array([len(p.priors)], np.int32)}),
        ("neighbours", lambda p: {"neighbours": p.neighbours[:26]}),
        ("neighbours", lambda p: {"neighbours": neighbours_with(p, -1)}),
        ("neighbours", lambda p: {"neighbours": neighbours_with(p, len(p.state))}),
        ("neighbours", lambda p: {"neighbours": neighbours_with(p, np.iinfo(np.int32).max)}),
        ("priors", lambda p: {"priors": p.priors[:-1]}),
        ("hidden weights", lambda p: {"hidden": p.hidden[:, :-1].copy()}),
        ("hidden bias", lambda p: {"bias": p.bias[:-1]}),
        ("output weights", lambda p: {"output": p.output.T.copy()}),
        ("stencil", lambda p: {"stencil": p.stencil[::-1].copy()}),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(
    said: str, spoil: Callable[[Problem], dict[str, AnyArray]]
) -> None:
    p = problem()
    spoiled = p.with_(**spoil(p))
    with pytest.raises(ShapeError, match=said):
        spoiled.forward(out=np.empty_like(p.state))
    with pytest.raises(ShapeError, match=said):
        spoiled.backward()


@needs_triton
@pytest.mark.parametrize(
    ("said", "spoil"),
    [
        ("state: expected shape", lambda p: {"state": p.state[:-1]}),
        ("state: expected shape", lambda p: {"state": p.state[:, 0]}),
        ("rows: expected int32", lambda p: {"rows": p.rows.astype(np.int64)}),
        ("neighbours: expected shape", lambda p: {"neighbours": p.neighbours[:26]}),
        ("priors: expected shape", lambda p: {"priors": p.priors[:-1]}),
        ("hidden weights: expected", lambda p: {"hidden": p.hidden[:, :-1].copy()}),
        ("hidden bias: expected shape", lambda p: {"bias": p.bias[:-1]}),
        ("output weights: expected", lambda p: {"output": p.output.T.copy()}),
        ("stencil: the Triton kernels", lambda p: {"stencil": p.stencil[::-1].copy()}),
    ],
)
def test_tensors_that_do_not_fit_are_refused_by_name_with_triton(
    said: str, spoil: Callable[[Problem], dict[str, AnyArray]]
) -> None:
    p = problem((2, 3, 4))
    with pytest.raises(ShapeError, match=said):
        run(triton_update, p.with_(**spoil(p)), torch.float32, DEVICE)
    with pytest.raises(ShapeError, match="state: expected float32 or shorter"):
        run(triton_update, p, torch.float64, DEVICE)


@needs_native
def test_an_output_that_overlaps_the_state_is_refused() -> None:
    p = problem()
    with pytest.raises(ShapeError, match="shares memory"):
        p.forward(out=p.state)
    with pytest.raises(ShapeError, match="out: expected shape"):
        p.forward(out=p.state[1:].copy())


@pytest.mark.parametrize("backend", ["reference", *KERNELS])
def test_steered_by_the_identity_cells_do_as_they_do_unsteered(backend: str) -> None:
    plain = problem(occupancy=0.7)
    identity = np.broadcast_to(np.eye(3, dtype=np.float32), (len(plain.priors), 3, 3)).copy()
    if backend == "reference":
        first, second = (
            run(reference.update, p, torch.float32)["state"]
            for p in (plain, plain.with_(steering=identity))
        )
    else:
        options = KERNELS[backend]
        first, second = (
            plain.forward(**options),
            plain.with_(steering=identity).forward(**options),
        )
    np.testing.assert_allclose(second, first, atol=1e-6)


def test_a_turned_pattern_steered_by_the_turn_does_what_it_did() -> None:
    """Of a quarter turn, which a grid can have exactly."""
    p = problem((6, 6, 6), probability=1, priors=0, border="circular")
    domain = Domain.from_mask(np.ones((6, 6, 6), bool), (0, 0, 0), border="circular")

    def turned(state: FloatArray) -> FloatArray:
        """At (x, y) is what was at (y, -x): a quarter turn about z."""
        dense = domain.scatter(state[:-1], domain.box)
        cells = domain.cells
        moved = dense[cells[:, 1], -cells[:, 0], cells[:, 2]]
        return np.concatenate([moved, state[-1:]])

    p = p.with_(neighbours=domain.neighbours)
    back = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], np.float32)
    steering = np.broadcast_to(back, (len(domain), 3, 3)).copy()
    once = run(reference.update, p, torch.float32)["state"]
    steered = p.with_(state=turned(p.state), steering=steering)
    np.testing.assert_allclose(
        run(reference.update, steered, torch.float32)["state"], turned(once), atol=1e-5
    )


@needs_native
def test_steering_that_does_not_fit_is_refused_by_name() -> None:
    p = problem(steered=True)
    assert p.steering is not None
    with pytest.raises(ShapeError, match=r"steering: expected shape \[\d+, 3, 3\]"):
        p.with_(steering=p.steering[:-1].copy()).forward()
    uneven = p.stencil.copy()
    uneven[2] *= 2
    with pytest.raises(ShapeError, match="stencil: to steer, the Sobel filters"):
        p.with_(stencil=uneven).forward()
