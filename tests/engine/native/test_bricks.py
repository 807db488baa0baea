"""Steps in bricks: the bits of the steps whose neighbours are listed, and checked as well."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vnca.core import AnyArray
from vnca.core.errors import ShapeError
from vnca.engine import Compute, native, open_session
from vnca.engine.automaton import Automaton, Weights, changing_rows, stencil
from vnca.engine.domain import Around, Border, Domain
from vnca.engine.native import bricks

pytestmark = pytest.mark.skipif(
    native.unavailable() is not None, reason="the native kernel was not built"
)
PRECISIONS = [
    precision
    for precision in ("float32", "bfloat16")
    if native.unavailable() is not None or native.unavailable(precision) is None
]


def draw(*shape: int, seed: int = 0) -> AnyArray:
    return np.random.default_rng(seed).standard_normal(shape, np.float32)


def automaton(channels: int, hidden: int, priors: int, probability: float = 0.5) -> Automaton:
    weights = Weights(
        draw(hidden, 5 * channels + priors) / 8, draw(hidden), draw(channels, hidden) / 8
    )
    return Automaton(weights, stencil(), probability, seed=3)


def scattered(share: float, border: Border, shape: tuple[int, int, int] = (21, 7, 30)) -> Domain:
    alive = np.random.default_rng(1).random(shape) < share
    return Domain.from_mask(alive, (-5, 3, 9), border=border)


def listed(
    state: AnyArray, domain: Domain, priors: AnyArray, of: Automaton, **how: Any
) -> AnyArray:
    rows = changing_rows(domain.hashes, seed=of.seed, step=7, probability=of.update_probability)
    return native.forward(state, rows, domain.neighbours, priors, *of.weights, of.stencil, **how)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("border", ["replicate", "circular"])
@pytest.mark.parametrize(
    ("share", "channels", "hidden", "priors", "probability"),
    [(1, 12, 128, 7, 0.5), (0.6, 12, 32, 7, 0.5), (0.1, 5, 33, 0, 1.0), (0.6, 20, 100, 16, 0.1)],
)
def test_the_bits_are_those_of_listed_neighbours(
    share: float,
    channels: int,
    hidden: int,
    priors: int,
    probability: float,
    border: Border,
    precision: str,
) -> None:
    domain, of = scattered(share, border), automaton(channels, hidden, priors, probability)
    state, given = draw(len(domain) + 1, channels), draw(len(domain), priors, seed=2)
    state[-1] = 0
    for instructions in native.instructions(precision):
        how: dict[str, Any] = {"precision": precision, "instructions": instructions}
        right = listed(state, domain, given, of, **how)
        for threads in (1, 3):
            got = bricks.forward(
                state,
                domain.around,
                domain.hashes.view(np.int32),
                given,
                of,
                7,
                threads=threads,
                **how,
            )
            np.testing.assert_array_equal(got.view(np.int32), right.view(np.int32))


@pytest.mark.parametrize(
    ("lower", "upper"), [((0, 0, 0), (1, 1, 1)), ((-1, 5, 7), (8, 6, 9)), ((0, 0, 0), (16, 8, 8))]
)
def test_every_row_around_a_brick_is_that_of_its_place(
    lower: tuple[int, int, int], upper: tuple[int, int, int]
) -> None:
    shape = np.subtract(upper, lower)
    for border in ("replicate", "circular"):
        domain = Domain.from_mask(np.ones(shape, bool), lower, border=border)
        rows, places = domain.around
        at = domain.rows.bricks[:, None] * 8 - 1 + np.indices((10, 10, 10)).reshape(3, -1).T
        near = ((at >= np.array(lower) - 1) & (at <= upper)).all(axis=-1)
        inside = (
            at.clip(lower, np.array(upper) - 1)
            if border == "replicate"
            else (at - lower) % shape + lower
        )
        number = {tuple(cell): row for row, cell in enumerate(domain.cells.tolist())}
        right = [number[tuple(cell)] for cell in inside[near].tolist()]
        assert rows.reshape(len(at), -1)[near].tolist() == right
        assert rows.reshape(-1)[places].tolist() == list(range(len(domain)))


def test_a_session_runs_without_touching_what_it_was_given() -> None:
    domain, of = scattered(0.7, "replicate"), automaton(12, 16, 7)
    session = open_session(of, domain, draw(len(domain), 7), Compute("native"))
    state = draw(len(domain) + 1, 12)
    state[-1] = 0
    before, seen = state.copy(), []
    after = session.read(session.run(session.upload(state), range(5), lambda: seen.append(0)))
    np.testing.assert_array_equal(state, before)
    for number in range(5):
        state = session.step(state, number)
    np.testing.assert_array_equal(after, state)
    assert len(seen) == 5


@pytest.mark.parametrize(
    ("what", "place", "value"),
    [
        ("rows", 13, -1),
        ("rows", 999, 2**31 - 1),
        ("places", 5, -1),
        ("places", -1, 0),
        ("places", 6, 2**31 - 1),
    ],
)
def test_what_is_out_of_range_is_refused(what: str, place: int, value: int) -> None:
    domain, of = scattered(0.7, "replicate"), automaton(4, 16, 1, 1.0)
    arrays = {name: array.copy() for name, array in domain.around._asdict().items()}
    arrays[what].reshape(-1)[place] = value
    state, given = draw(len(domain) + 1, 4), draw(len(domain), 1)
    hashes = domain.hashes.view(np.int32)
    words = f"bricks: expected rows of the state, from 0 to {len(domain)}, and places"
    with pytest.raises(ShapeError, match=words):
        bricks.forward(state, Around(**arrays), hashes, given, of, 0)


def test_an_output_upon_an_input_is_refused() -> None:
    domain, of = scattered(0.7, "replicate"), automaton(4, 16, 1)
    state, given = draw(len(domain) + 1, 4), draw(len(domain), 1)
    hashes = domain.hashes.view(np.int32)
    with pytest.raises(ShapeError, match="shares memory"):
        bricks.forward(state, domain.around, hashes, given, of, 0, out=state)


def test_weights_for_other_priors_are_refused() -> None:
    domain = scattered(0.7, "replicate")
    of = replace(automaton(4, 16, 1), weights=automaton(4, 16, 2).weights)
    state, given = draw(len(domain) + 1, 4), draw(len(domain), 1)
    with pytest.raises(ShapeError, match="hidden weights"):
        bricks.forward(state, domain.around, domain.hashes.view(np.int32), given, of, 0)
