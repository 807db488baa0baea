"""States are carried natively as they are in numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.engine.test_domain import random_domain

from vnca.core import Box
from vnca.core.errors import ShapeError
from vnca.engine import native
from vnca.engine.carrying import carried, carried_by_numpy
from vnca.engine.domain import Domain

pytestmark = pytest.mark.skipif(native.unavailable() is not None, reason="no native extension")


def state_of(domain: Domain, channels: int, seed: int) -> np.ndarray:
    state = np.random.default_rng(seed).standard_normal((len(domain) + 1, channels))
    state[-1] = 0
    return state.astype(np.float32)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 1000),
    st.sampled_from([0.0, 0.4, 3.0, 1e4]),
    st.sampled_from(["replicate", "circular"]),
    st.integers(1, 13),
)
def test_natively_as_in_numpy(seed: int, speed: float, border: str, channels: int) -> None:
    before = random_domain(seed, (11, 9, 12), border)
    after = Domain(random_domain(seed + 1, (11, 9, 12), border).cells, before.box, before.border)
    moved = np.random.default_rng(seed).standard_normal((len(after), 3))
    moved = (speed * moved).astype(np.float32)
    state = state_of(before, channels, seed)
    expected = carried_by_numpy(state, before, after, moved)
    np.testing.assert_allclose(carried(state, before, after, moved), expected, atol=2e-6)


def test_bits_do_not_depend_on_the_number_of_threads() -> None:
    domain = Domain.filling(Box((0, 0, 0), (20, 20, 20)))
    moved = np.random.default_rng(0).standard_normal((len(domain), 3)).astype(np.float32)
    state = state_of(domain, 12, 1)
    one, three = (carried(state, domain, domain, moved, threads=count) for count in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_a_line_of_the_state_is_carried_exactly() -> None:
    domain = Domain.filling(Box((0, 0, 0), (12, 12, 12)))
    state = np.append(domain.cells @ np.array([1, 2, 3]), 0).astype(np.float32)[:, None]
    moved = np.random.default_rng(0).uniform(-2, 2, (len(domain), 3)).astype(np.float32)
    upstream = domain.cells - moved
    inside = ((upstream > 1) & (upstream < 10)).all(axis=1)
    expected = upstream @ np.array([1, 2, 3])
    got = carried(state, domain, domain, moved)[:-1, 0]
    np.testing.assert_allclose(got[inside], expected[inside], atol=2e-5)


def test_a_fine_pattern_outlives_twenty_frames_better_than_linearly() -> None:
    """Waves of six cells that are carried half a cell a frame: linearly 6 % of them are left."""
    domain = Domain.filling(Box((0, 0, 0), (30, 4, 4)))
    domain = Domain(domain.cells, domain.box, "circular")
    state = np.append(np.sin(domain.cells[:, 0] * np.pi / 3), 0).astype(np.float32)[:, None]
    moved = np.full((len(domain), 3), [0.5, 0, 0], np.float32)
    for _ in range(20):
        state = carried(state, domain, domain, moved)
    expected = np.sin((domain.cells[:, 0] - 10) * np.pi / 3)
    left = (state[:-1, 0] * expected).sum() / (expected * expected).sum()
    assert left > 0.5 > 8 * np.cos(np.pi / 6) ** 20


def test_movements_that_are_not_finite_are_refused() -> None:
    domain = Domain.filling(Box((0, 0, 0), (3, 3, 3)))
    moved = np.full((len(domain), 3), np.nan, np.float32)
    with pytest.raises(ShapeError, match="carrying: movement: expected finite numbers"):
        carried(state_of(domain, 2, 0), domain, domain, moved)


def test_rows_that_the_state_has_not_are_refused() -> None:
    domain = Domain.filling(Box((0, 0, 0), (3, 3, 3)))
    moved = np.zeros((len(domain), 3), np.float32)
    with pytest.raises(ShapeError, match="rows: expected rows of the state"):
        carried(state_of(domain, 2, 0)[5:], domain, domain, moved)
