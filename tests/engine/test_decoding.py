"""Every backend of decoding against the reference in float64."""

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import torch
from torch import Tensor

from vnca.core import AnyArray, Box, FloatArray, IntArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import ShapeError
from vnca.engine import native
from vnca.engine import numpy as array_reference
from vnca.engine.automaton import DecoderWeights
from vnca.engine.domain import Domain, subdivided
from vnca.engine.native import decoding
from vnca.engine.native.autograd import decode as native_decode
from vnca.engine.reference import equations as reference
from vnca.engine.triton import decode as triton_backend
from vnca.engine.triton.step import unavailable

KERNELS = [] if native.unavailable() else decoding.decode_instructions()
needs_native = pytest.mark.skipif(not KERNELS, reason="the native kernel was not built")

# The Triton kernels run on the GPU if there is one, else in Triton's interpreter.
GPU = torch.cuda.is_available()
DEVICE = "cuda" if GPU else "cpu"
needs_triton = pytest.mark.skipif(unavailable(DEVICE) is not None, reason=str(unavailable(DEVICE)))
triton_decode = partial(triton_backend.decode, precision="ieee")


@dataclasses.dataclass(frozen=True)
class Problem:
    """The arguments of decoding, and a gradient of its result."""

    state: FloatArray
    rows: IntArray
    fractions: FloatArray
    weights: DecoderWeights
    gradient: FloatArray

    def with_(self, **changes: object) -> "Problem":
        return dataclasses.replace(self, **changes)

    def forward(self, **options: object) -> FloatArray:
        return decoding.decode(
            self.state, self.rows, self.fractions, self.weights, **options  # pyright: ignore
        )  # fmt: skip

    def backward(self, **options: object) -> list[FloatArray]:
        arguments = (self.state, self.rows, self.fractions, self.weights, self.gradient)
        to_state, to_weights = decoding.decode_backward(*arguments, **options)  # pyright: ignore
        return [to_state, *to_weights]


def problem(
    points: int = 301,
    *,
    cells: int = 200,
    channels: int = 12,
    units: int = 32,
    outside: float = 0.2,
    frequency: float = 10.0,
) -> Problem:
    """Weights as training draws them, rows anywhere, some of the points at corners."""
    random = np.random.default_rng(4)

    def draw(*lengths: int, scale: float = 1.0) -> FloatArray:
        return (scale * random.standard_normal(lengths)).astype(np.float32)

    state = draw(cells + 1, channels, scale=0.5)
    state[-1] = 0
    rows = random.integers(0, cells + 1, (8, points), dtype=np.int32)
    rows[random.random(rows.shape) < outside] = cells
    fractions = random.random((points, 3), np.float32)
    fractions[::7, 1] = random.integers(0, 2, len(fractions[::7]))
    weights = DecoderWeights(
        draw(units, channels, scale=frequency / (2 * channels)),
        draw(units, scale=frequency / 4),
        draw(units, units, scale=1.4 / units**0.5),
        draw(units, scale=1.4),
        draw(units, units, scale=1.4 / units**0.5),
        draw(units, scale=1.4),
        draw(4, units, scale=1.4 / units**0.5),
        draw(4),
    )
    return Problem(state, rows, fractions, weights, draw(points, 4))


NAMES = ("seen", "to state", *(f"to {name}" for name in DecoderWeights._fields))


def run(
    decode: Callable[..., Tensor], p: Problem, dtype: torch.dtype, device: str = "cpu"
) -> dict[str, AnyArray]:
    """What is seen, and the gradients."""

    def tensor(array: AnyArray, *, trained: bool = False) -> Tensor:
        return torch.tensor(array, dtype=dtype, device=device, requires_grad=trained)

    state = tensor(p.state, trained=True)
    weights = DecoderWeights(*(tensor(w, trained=True) for w in p.weights))
    rows = torch.tensor(p.rows, device=device)
    result = decode(state, rows, tensor(p.fractions), weights)
    gradients = torch.autograd.grad(result, (state, *weights), tensor(p.gradient))
    arrays = (t.detach().numpy(force=True) for t in (result, *gradients))
    return dict(zip(NAMES, arrays, strict=True))


def assert_conforms(
    got: dict[str, AnyArray], expected: dict[str, AnyArray], *, atol: float = 3e-6
) -> None:
    for name, exact in expected.items():
        assert got[name].shape == exact.shape, name
        scale = np.abs(exact).max(initial=1e-30)
        np.testing.assert_allclose(got[name] / scale, exact / scale, atol=atol, err_msg=name)


CASES = {
    "default": {},
    "several ranges": {"points": 5000, "cells": 3001},
    "no point": {"points": 0},
    "one point": {"points": 1, "cells": 1},
    "no active cell": {"cells": 0},
    "all outside": {"outside": 1.0},
    "fewest channels": {"points": 40, "channels": 4, "units": 1},
    "odd": {"points": 49, "channels": 5, "units": 17},
    "widest": {"points": 97, "channels": 64, "units": 128},
    "channels beyond a vector": {"points": 100, "channels": 20, "units": 40},
    "high frequency": {"frequency": 60.0},
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("backend", ["reference", *KERNELS])
def test_what_is_seen_and_all_its_gradients_agree_with_the_reference(
    case: str, backend: str
) -> None:
    p = problem(**CASES[case])
    exact = run(reference.decode, p, torch.float64)
    if backend == "reference":
        got = run(reference.decode, p, torch.float32)
    else:
        arrays = (p.forward(instructions=backend), *p.backward(instructions=backend))
        got = dict(zip(NAMES, arrays, strict=True))
    assert_conforms(got, exact, atol=2e-5 if case == "high frequency" else 3e-6)


@pytest.mark.parametrize("case", CASES)
def test_decoding_in_numpy_agrees_with_the_reference(
    case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(array_reference, "SLAB", 50)
    p = problem(**CASES[case])
    got = array_reference.decode(p.state, p.rows, p.fractions, p.weights)
    assert got.dtype == np.float32
    exact = run(reference.decode, p, torch.float64)["seen"]
    atol = 2e-5 if case == "high frequency" else 3e-6
    assert_conforms({"seen": got}, {"seen": exact}, atol=atol)


TRITON_CASES = {
    "two tiles": {"points": 70, "cells": 100, "channels": 5, "units": 17},
    "two widths": {"points": 5, "cells": 3, "channels": 20, "units": 24},
    "fewest channels": {"points": 9, "channels": 4, "units": 1},
    **{name: CASES[name] for name in ("no point", "one point", "no active cell")},
}
if GPU:
    TRITON_CASES |= {name: case for name, case in CASES.items() if case.get("units", 0) <= 32}


@needs_triton
@pytest.mark.parametrize("case", TRITON_CASES)
def test_triton_agrees_with_the_reference(case: str) -> None:
    p = problem(**({} if GPU else {"points": 9}) | TRITON_CASES[case])
    got = run(triton_decode, p, torch.float32, DEVICE)
    assert_conforms(got, run(reference.decode, p, torch.float64))


@needs_triton
def test_triton_results_are_the_same_bits_in_every_run() -> None:
    p = problem(5000 if GPU else 9, cells=30, units=5)
    first, second = (run(triton_decode, p, torch.float32, DEVICE) for _ in range(2))
    for name, array in first.items():
        assert array.tobytes() == second[name].tobytes(), name


def test_gradients_of_the_reference_are_those_of_its_function(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(reference, "SLAB", 4)
    p = problem(7, cells=5, channels=5, units=3, frequency=3)
    p.rows[p.rows == 5] = 4  # the outside is a constant, so its gradient is zero
    arrays = (p.state, *p.weights)
    inputs = [torch.tensor(a, dtype=torch.float64, requires_grad=True) for a in arrays]
    rows, fractions = torch.tensor(p.rows), torch.tensor(p.fractions, dtype=torch.float64)

    def decode(state: Tensor, *weights: Tensor) -> Tensor:
        return reference.decode(state, rows, fractions, DecoderWeights(*weights))

    assert torch.autograd.gradcheck(decode, inputs)


@pytest.mark.parametrize("backend", ["reference", "native", "triton"])
def test_the_gradient_of_the_outside_is_zero(backend: str) -> None:
    p = problem(20, cells=3, outside=0.5, units=5)
    if backend == "native" and KERNELS:
        to_state = p.backward()[0]
    elif backend == "triton" and unavailable(DEVICE) is None:
        to_state = run(triton_decode, p, torch.float32, DEVICE)["to state"]
    else:
        to_state = run(reference.decode, p, torch.float32)["to state"]
    assert (to_state[-1] == 0).all()
    assert (to_state[:-1] != 0).all()


@needs_native
def test_training_gets_the_native_gradients() -> None:
    p = problem()
    got = run(native_decode, p, torch.float32)
    for array, expected in zip(got.values(), (p.forward(), *p.backward()), strict=True):
        np.testing.assert_array_equal(array, expected)


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
def test_results_are_the_same_bits_in_every_run_and_with_any_number_of_threads(
    backend: str,
) -> None:
    p = problem(5001, cells=2500)
    options = [{"threads": threads, "instructions": backend} for threads in (1, 1, 2, 3, 8)]
    for results in zip(*([p.forward(**o), *p.backward(**o)] for o in options), strict=True):
        assert len({array.tobytes() for array in results}) == 1


def domain(occupancy: float = 0.6) -> Domain:
    return Domain.from_mask(np.random.default_rng(0).random((5, 6, 7)) < occupancy, (-3, 0, 5))


CUTS = [(1, 1), (1, 3), (1, 8), (2, 1), (2, 2), (3, 2), (4, 2), (5, 1), (6, 1), (7, 1), (8, 1)]
"""Parts along a cell, and points along a part."""


@pytest.mark.parametrize(("parts", "samples"), CUTS)
@pytest.mark.parametrize("backend", ["reference", *KERNELS])
def test_parts_of_cells_show_the_means_of_their_points(
    parts: int, samples: int, backend: str
) -> None:
    cells = domain()
    p = problem(1, cells=len(cells))
    chosen = np.random.default_rng(1).permutation(len(cells))[:5].astype(np.int32)
    arguments = (p.state, chosen, cells.neighbours, parts, samples, p.weights, 0.3)
    if backend == "reference":
        colour, change = array_reference.decode_parts(*arguments)
    else:
        colour, change = decoding.decode_parts(*arguments, instructions=backend, threads=2)
    points = subdivided(chosen, cells.neighbours, parts * samples)
    seen = array_reference.decode(p.state, *points, p.weights).astype(float)
    seen = seen.reshape(5, *3 * (parts, samples), 4)
    light = srgb_to_linear(np.clip(seen[..., :3] + 0.5, 0, 1)).mean((2, 4, 6))
    assert ((light > 0.05) & (light < 0.95)).any()
    assert (np.abs(seen[..., 3]) > 0.3).any()
    np.testing.assert_allclose(colour, light, atol=3e-5)
    np.testing.assert_allclose(change, np.clip(seen[..., 3], -0.3, 0.3).mean((2, 4, 6)), atol=3e-5)


def shown(values: FloatArray, backend: str) -> tuple[FloatArray, FloatArray]:
    """What cells show whose decoder adds nothing: the light of values `[n]`, and them as Δd."""
    state = np.repeat(np.append(values, np.float32(0)).astype(np.float32)[:, None], 4, axis=1)
    nothing = DecoderWeights(*(np.zeros(s, np.float32) for s in DecoderWeights.shapes(4, 1)))
    cells = np.arange(len(values), dtype=np.int32)
    arguments = (state, cells, np.tile(cells, (27, 1)), 1, 1, nothing, 0.5)
    colour, change = decoding.decode_parts(*arguments, instructions=backend)
    return colour[:, 0, 0, 0], change[:, 0, 0, 0]


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
def test_light_is_that_of_srgb_over_its_whole_range(backend: str) -> None:
    values = np.append(np.linspace(-0.7, 0.7, 200_001), [0.04045 - 0.5]).astype(np.float32)
    colour, change = shown(values, backend)
    exact = srgb_to_linear(np.clip(values.astype(float) + 0.5, 0, 1))
    # Half of the last place of values around ½ is what they have in all.
    np.testing.assert_allclose(colour[:, 1], exact, rtol=2e-6, atol=2e-7)
    np.testing.assert_array_equal(colour[:, 0], colour[:, 2])
    assert colour.min() == 0
    np.testing.assert_allclose(colour.max(), 1, rtol=4e-7)
    np.testing.assert_array_equal(change, np.clip(values, -0.5, 0.5))


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
def test_what_is_no_number_stays_visible_in_its_cell(backend: str) -> None:
    values = np.full(40, 0.1, np.float32)
    values[[3, 17]] = np.nan
    for shows in shown(values, backend):
        wrong = np.isnan(shows).reshape(40, -1)
        np.testing.assert_array_equal(np.flatnonzero(wrong.all(axis=1)), [3, 17])
        assert wrong.sum() == 2 * wrong.shape[1]


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
def test_a_cell_shows_the_same_bits_whatever_is_shown_with_it(backend: str) -> None:
    cells = Domain.filling(Box((0, 0, 0), (14, 13, 12)))
    p = problem(1, cells=len(cells))
    every = np.arange(len(cells), dtype=np.int32)

    def parts(chosen: IntArray, threads: int) -> list[FloatArray]:
        arguments = (p.state, chosen, cells.neighbours, 1, 3, p.weights, 0.5)
        return list(decoding.decode_parts(*arguments, instructions=backend, threads=threads))

    whole = parts(every, 1)
    for chosen, threads in ((every, 3), (every[5:1900], 2), (every[::-1].copy(), 2)):
        for got, expected in zip(parts(chosen, threads), whole, strict=True):
            np.testing.assert_array_equal(got, expected[chosen])


@pytest.mark.parametrize("factor", [1, 2, 3, 8])
def test_parts_lie_where_a_finer_grid_has_its_cells(factor: int) -> None:
    """A field that is linear in space is interpolated exactly: the centres are read off."""
    cells = Domain.from_mask(np.ones((3, 3, 3), bool), (0, 0, 0))
    middle = np.flatnonzero((cells.cells == 1).all(axis=1)).astype(np.int32)
    rows, fractions = subdivided(middle, cells.neighbours, factor)
    field = np.append(cells.cells, [[9, 9, 9]], axis=0).astype(np.float32)
    at = array_reference.interpolate(field, rows, fractions).reshape(*3 * (factor,), 3)
    centres = 0.5 + (np.arange(factor) + 0.5) / factor
    expected = np.stack(np.meshgrid(centres, centres, centres, indexing="ij"), axis=-1)
    np.testing.assert_allclose(at, expected, atol=1e-6)


@needs_native
@pytest.mark.parametrize("backend", KERNELS)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_state_gone_wrong_stays_visible_and_local(backend: str, bad: float) -> None:
    p = problem()
    state = p.state.copy()
    state[7, 5] = bad
    got = p.with_(state=state).forward(instructions=backend)
    reached = (p.rows == 7).any(axis=0)
    assert reached.any()
    np.testing.assert_array_equal(np.isnan(got).any(axis=1), reached)
    np.testing.assert_array_equal(got[~reached], p.forward(instructions=backend)[~reached])


@needs_native
def test_every_value_of_the_output_is_written() -> None:
    p = problem(5000)
    out = np.full((5000, 4), np.nan, np.float32)
    assert p.forward(out=out) is out
    np.testing.assert_array_equal(out, p.forward())


@needs_native
def test_arrays_in_read_only_memory_can_be_used() -> None:
    p = problem()
    expected = p.forward()
    for array in (p.state, p.rows, p.fractions, *p.weights):
        array.setflags(write=False)
    np.testing.assert_array_equal(p.forward(), expected)


def changed(array: AnyArray, value: float) -> AnyArray:
    copy = array.copy()
    copy.flat[-1] = value
    return copy


MISFITS: list[tuple[str, Callable[[Problem], dict[str, object]]]] = [
    ("state", lambda p: {"state": p.state.astype(np.float64)}),
    ("state", lambda p: {"state": p.state[:, 0]}),
    ("rows", lambda p: {"rows": p.rows[:7]}),
    ("rows", lambda p: {"rows": p.rows[:, :-1].copy()}),
    ("rows", lambda p: {"rows": p.rows.astype(np.int64)}),
    ("fractions", lambda p: {"fractions": p.fractions[:, :2].copy()}),
    ("fractions", lambda p: {"fractions": p.fractions[:, 0]}),
    ("first weights", lambda p: {"weights": p.weights._replace(first=p.weights.first[:, 1:])}),
    ("first bias", lambda p: {"weights": p.weights._replace(first_bias=p.weights.output_bias)}),
    ("second weights", lambda p: {"weights": p.weights._replace(second=p.weights.first)}),
    ("third bias", lambda p: {"weights": p.weights._replace(third_bias=p.weights.third)}),
    ("output weights", lambda p: {"weights": p.weights._replace(output=p.weights.output[:3])}),
    ("output bias", lambda p: {"weights": p.weights._replace(output_bias=p.weights.first_bias)}),
]
NATIVE_MISFITS = [
    *MISFITS,
    ("state", lambda p: {"state": np.asfortranarray(p.state)}),
    ("at least|4 to 64", lambda p: {"state": p.state[:, :3].copy()}),
    ("cells", lambda p: {"state": p.state[:0]}),
    ("rows: expected rows", lambda p: {"rows": changed(p.rows, -1)}),
    ("rows: expected rows", lambda p: {"rows": changed(p.rows, len(p.state))}),
    ("rows: expected rows", lambda p: {"rows": changed(p.rows, np.iinfo(np.int32).max)}),
    ("decoding: expected arrays", lambda p: {"weights": p.weights[:7]}),
]


@needs_native
@pytest.mark.parametrize(("said", "spoil"), NATIVE_MISFITS)
def test_arrays_that_do_not_fit_are_refused_by_name(
    said: str, spoil: Callable[[Problem], dict[str, object]]
) -> None:
    spoiled = problem().with_(**spoil(problem()))
    with pytest.raises(ShapeError, match=said):
        spoiled.forward()
    if len(spoiled.weights) == len(DecoderWeights._fields):
        with pytest.raises(ShapeError, match=said):
            spoiled.backward()


@needs_triton
@pytest.mark.parametrize(("said", "spoil"), MISFITS)
def test_tensors_that_do_not_fit_are_refused_by_name_with_triton(
    said: str, spoil: Callable[[Problem], dict[str, object]]
) -> None:
    p = problem(9).with_(**spoil(problem(9)))
    dtype = torch.float64 if p.state.dtype == np.float64 else torch.float32
    with pytest.raises(ShapeError, match=said.removesuffix(" weights")):
        run(triton_decode, p, dtype, DEVICE)


@needs_triton
@pytest.mark.parametrize("wide", [{"units": 33}, {"channels": 33}, {"channels": 3}])
def test_networks_too_large_for_triton_are_refused(wide: dict[str, int]) -> None:
    with pytest.raises(ShapeError, match="4 to 32 channels and 1 to 32 units"):
        run(triton_decode, problem(9, **wide), torch.float32, DEVICE)


@needs_native
def test_cells_and_parts_that_cannot_be_are_refused() -> None:
    cells = domain()
    p, around = problem(1, cells=len(cells)), cells.neighbours
    chosen = np.arange(3, dtype=np.int32)
    for parts in (-1, 0, 9):
        with pytest.raises(ShapeError, match=f"1 to 8 parts along a cell, got {parts}"):
            decoding.decode_parts(p.state, chosen, around, parts, 1, p.weights, 0.5)
    for samples in (-1, 0, 3):
        with pytest.raises(ShapeError, match=f"3 to 8 points along a cell, got {3 * samples}"):
            decoding.decode_parts(p.state, chosen, around, 3, samples, p.weights, 0.5)
    for wrong, neighbours in (
        (changed(chosen, -1), around),
        (changed(chosen, len(cells)), around),
        (np.array([len(cells) - 1], np.int32), changed(around, len(cells) + 1)),
    ):
        with pytest.raises(ShapeError, match="cells or neighbours"):
            decoding.decode_parts(p.state, wrong, neighbours, 3, 2, p.weights, 0.5)
    with pytest.raises(ShapeError, match="neighbours: expected shape"):
        decoding.decode_parts(p.state, chosen, around[:26], 2, 2, p.weights, 0.5)


@needs_native
def test_an_output_that_overlaps_an_input_is_refused() -> None:
    p = problem()
    memory = np.zeros(len(p.fractions) * 7, np.float32)
    fractions = memory[: p.fractions.size].reshape(p.fractions.shape)
    upon = memory[p.fractions.size - 1 :][: 4 * len(fractions)].reshape(-1, 4)
    with pytest.raises(ShapeError, match="shares memory"):
        p.with_(fractions=fractions).forward(out=upon)
    with pytest.raises(ShapeError, match="out: expected shape"):
        p.forward(out=memory.reshape(-1, 7))
