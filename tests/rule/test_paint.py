"""What is seen of a state, at its cells and between them."""

from dataclasses import replace

import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import BackendUnavailableError
from vnca.engine import native
from vnca.engine.domain import Border, Domain, subdivided
from vnca.rule import Decoder, Rule, RuleConfig, Scales
from vnca.rule.paint import Between, colours, density_factors

BACKENDS = ["numpy"] if native.unavailable() else ["numpy", "native"]


def rule(*, decoder: bool = True) -> Rule:
    plain = Rule.initial(RuleConfig(hidden=1), Scales(), seed=0)
    return replace(plain, decoder=Decoder.initial(12, seed=0)) if decoder else plain


def domain(border: Border = "replicate") -> Domain:
    alive = np.random.default_rng(1).random((5, 9, 7)) < 0.7
    return Domain.from_mask(alive, (-3, 4, 0), border=border)


def state_of(cells: Domain) -> FloatArray:
    state = np.random.default_rng(2).uniform(-0.5, 0.5, (len(cells) + 1, 12)).astype(np.float32)
    state[-1] = 0
    return state


def test_without_a_decoder_states_are_interpolated() -> None:
    cells = domain()
    state = state_of(cells)
    between = Between(rule(decoder=False))
    at_cells = between.at(state, *cells.corners(cells.cells))
    np.testing.assert_array_equal(at_cells, state[:-1, :4])
    halfway = between.at(state, *cells.corners(cells.cells + np.array([0, 0, 0.5])))
    beside = np.append(state, state[-1:], axis=0)[cells.neighbours[14]]
    np.testing.assert_allclose(halfway, (state[:-1] + beside)[:, :4] / 2, atol=1e-7)


@pytest.mark.parametrize("backend", BACKENDS)
def test_colours_and_densities_come_through_the_decoder(backend: str) -> None:
    cells, painted = domain(), rule()
    assert painted.decoder is not None
    state = state_of(cells)
    random = np.random.default_rng(0)
    points = cells.cells[random.integers(0, len(cells), 200)] + random.random((200, 3))
    rows, fractions = cells.corners(points)
    seen = Between(painted, backend).at(state, rows, fractions)

    w, hidden = painted.decoder.weights, Between(rule(decoder=False))
    whole = np.stack(
        [hidden.at(np.roll(state, -c, axis=1), rows, fractions)[:, 0] for c in range(12)], axis=1
    )
    h = np.sin(whole @ w.first.T.astype(float) + w.first_bias)
    h = np.sin(np.sin(h @ w.second.T + w.second_bias) @ w.third.T + w.third_bias)
    expected = whole[:, :4] + h @ w.output.T + w.output_bias
    np.testing.assert_allclose(seen, expected, atol=2e-5)
    assert (np.abs(expected - whole[:, :4]) > 0.05).any()  # the network says something

    shown = srgb_to_linear(np.clip(expected[:, :3] + 0.5, 0, 1))
    np.testing.assert_allclose(colours(seen), shown, atol=5e-5)
    factors = 1 + 0.7 * np.clip(expected[:, 3], -0.5, 0.5)
    np.testing.assert_allclose(density_factors(seen, strength=0.7), factors, atol=2e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("decoder", [True, False])
def test_parts_of_cells_show_what_their_points_do(backend: str, decoder: bool) -> None:
    cells = domain()
    state, between = state_of(cells), Between(rule(decoder=decoder), backend)
    colour, change = between.parts(state, cells, 8)
    steps = (np.arange(8) + 0.5) / 8 - 0.5
    points = cells.cells[:, None, None, None] + np.stack(
        np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1
    )
    seen = between.at(state, *cells.corners(points.reshape(-1, 3)))
    np.testing.assert_allclose(colour, colours(seen).reshape(colour.shape), atol=5e-6)
    np.testing.assert_allclose(1 + change, density_factors(seen).reshape(change.shape), atol=5e-6)


@pytest.mark.parametrize("border", ["replicate", "circular"])
def test_what_lies_beyond_the_border_is_repeated_or_wrapped(border: Border) -> None:
    cells = domain(border)
    every = np.arange(len(cells), dtype=np.int32)
    rows, fractions = subdivided(every, cells.neighbours, 2)
    steps = np.stack(np.meshgrid(*3 * ([-0.25, 0.25],), indexing="ij"), axis=-1).reshape(-1, 3)
    points = (cells.cells[:, None] + steps).reshape(-1, 3)
    got_rows, got_fractions = cells.corners(points)
    np.testing.assert_array_equal(got_rows, rows)
    np.testing.assert_array_equal(got_fractions, fractions)
    far = np.array([[-1000.5, 6.25, 3.5], [1e9, -1e9, 0.0]])
    rows, _ = cells.corners(far)
    assert rows.shape == (8, 2)
    assert ((rows >= 0) & (rows <= len(cells))).all()


def test_points_anywhere_find_the_cells_around_them() -> None:
    cells = domain()
    random = np.random.default_rng(0)
    points = random.uniform((-3, 4, 0), (1, 12, 6), (300, 3))
    rows, fractions = cells.corners(points)
    row_of = {tuple(cell): row for row, cell in enumerate(cells.cells.tolist())}
    for corner, found in zip(np.ndindex(2, 2, 2), rows, strict=True):
        around = np.floor(points).astype(int) + corner
        expected = [row_of.get(tuple(cell), len(cells)) for cell in around.tolist()]
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(fractions, points - np.floor(points), atol=1e-7)
    assert rows.dtype == np.int32
    assert fractions.dtype == np.float32


def test_a_backend_that_cannot_run_is_refused() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "_native", None)
        patch.setattr(native, "_reason", "no compiler", raising=False)
        with pytest.raises(BackendUnavailableError, match="native cannot run"):
            Between(rule(), "native")


@pytest.mark.parametrize(("backend", "same"), [("triton", "auto"), ("reference", "numpy")])
def test_where_the_automaton_computes_on_tensors_arrays_are_decoded(
    backend: str, same: str
) -> None:
    cells = domain()
    at = cells.corners(cells.cells + 0.25)
    seen, expected = (Between(rule(), one).at(state_of(cells), *at) for one in (backend, same))
    np.testing.assert_array_equal(seen, expected)


def test_nothing_lives_nowhere() -> None:
    empty = Domain.from_mask(np.zeros((2, 3, 4), bool), (0, 0, 0))
    rows, fractions = empty.corners(np.array([[0.5, 1.0, 2.0]]))
    np.testing.assert_array_equal(rows, 0)
    seen = Between(rule(decoder=False)).at(empty.seed(12), rows, fractions)
    np.testing.assert_array_equal(seen, 0)
