"""Scenes without walls: the paper's jet, a plume against a sphere, billowy smoke."""

import numpy as np
import pytest

from vnca.simulation import simulate


def centre(density: np.ndarray) -> np.ndarray:
    at = np.indices(density.shape).reshape(3, -1)
    return at @ density.ravel() / density.sum()


def test_the_jet_is_the_papers() -> None:
    frames = list(simulate("jet", resolution=20, frames=30, seed=0))
    first, last = frames[0], frames[-1]
    assert first.density.shape == (20, 20, 30)
    # A ball of 0.12 widths at a fifth of the width, 15 % of the height, in the middle.
    ball = 4 / 3 * np.pi * (0.12 * 20) ** 3
    assert first.density.sum() == pytest.approx(ball, rel=0.15)
    np.testing.assert_allclose(
        centre(first.density), [0.2 * 20 - 0.5, 9.5, 0.15 * 30 - 0.5], atol=0.6
    )
    assert first.velocity is not None
    assert first.velocity[..., 0].max() == pytest.approx(4 * 20 / 200, rel=0.4)
    # It blows across and rises; nothing fades.
    across, _, up = centre(last.density) - centre(first.density)
    assert across > 1
    assert up > 0.5
    assert last.density.max() == 1
    assert last.density.sum() > 2 * ball


def test_smoke_goes_around_the_sphere() -> None:
    (*_, last) = simulate("sphere", resolution=20, frames=45, seed=0)
    x, y, z = ((np.arange(n) + 0.5) / 20 for n in last.density.shape)
    ball = (x[:, None, None] - 0.5) ** 2 + (y[:, None] - 0.5) ** 2 + (z - 0.72) ** 2 < 0.11**2
    assert ball.any()
    assert not last.density[ball].any()
    assert last.density[..., 18:].sum() > 20


def test_open_sides_let_smoke_out() -> None:
    masses = [v.density.sum() for v in simulate("billowy", resolution=12, frames=60, seed=0)]
    assert max(masses) > 1.2 * masses[-1] or np.ptp(masses[-10:]) < 0.2 * masses[-1]
