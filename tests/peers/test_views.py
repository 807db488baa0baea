import numpy as np
import pytest
import torch

from vnca.peers.transport import places
from vnca.peers.views import FRONT, Frustum, brightness, drawn_views, pictures

SHAPE = (14, 10, 18)


def ball(centre: tuple[float, float, float], radius: float = 3.0) -> torch.Tensor:
    at = places(SHAPE, torch.zeros(1))
    distance = (at - torch.tensor(centre)).norm(dim=-1)
    return (radius + 0.5 - distance).clamp(0, 1)


def test_a_thin_slab_is_as_bright_as_it_is_thick_and_a_thick_one_as_its_colour() -> None:
    slab = torch.ones(SHAPE)
    assert torch.allclose(brightness(slab, *FRONT, 1e-6), torch.tensor(10.0), atol=1e-3)
    # Σ e^{−γk}, k from 1: the published sum has each cell in its own way.
    expected = sum(np.exp(-0.5 * k) for k in range(1, 11))
    assert brightness(slab, *FRONT, 0.5)[3, 4] == pytest.approx(expected, rel=1e-5)


def test_up_is_up_and_right_is_right_from_the_front() -> None:
    seen = brightness(ball((10.0, 5.0, 14.0)), *FRONT, 0.1)
    assert seen.shape == (18, 14)
    row, column = divmod(int(seen.argmax()), 14)
    assert (row, column) == (17 - 14, 10)


def test_the_side_shows_what_the_front_hides() -> None:
    smoke = ball((7.0, 7.0, 9.0), 2.0)
    frustum = Frustum.around(SHAPE)
    seen = brightness(smoke, 90.0, 0.0, 1e-3, frustum)
    assert seen.shape == (18, frustum.columns)
    # From the +x side, +y is to the right.
    column = (seen.sum(0) * torch.arange(frustum.columns)).sum() / seen.sum()
    middle = (frustum.columns - 1) / 2
    assert float(column) - middle == pytest.approx(7.0 - 4.5, abs=0.1)
    assert seen.sum() == pytest.approx(float(smoke.sum()), rel=0.02)


def test_a_ball_stays_round_from_the_side_unless_sheared_as_published() -> None:
    smoke = ball((6.5, 4.5, 8.5), 3.0)
    turned = brightness(smoke, 45.0, 0.0, 1e-3)
    front = brightness(smoke, *FRONT, 1e-3)
    assert (turned - front).abs().max() < 0.3 * front.max()
    assert turned.sum() == pytest.approx(float(front.sum()), rel=0.02)
    sheared = brightness(smoke, 45.0, 0.0, 1e-3, sheared=True)
    assert abs(float(sheared.sum() / front.sum()) - 1) > 0.1 or (
        (sheared - front).abs().max() > 2 * (turned - front).abs().max()
    )


def test_the_brightest_pixel_of_all_views_is_one() -> None:
    views = pictures(ball((7.0, 5.0, 9.0)), [FRONT, (30.0, 10.0)], 0.2)
    assert views.shape == (2, 1, 18, 14)
    assert views.max() == 1
    assert pictures(torch.zeros(SHAPE), [FRONT], 0.2).max() == 0


def test_views_are_drawn_apart_from_each_other_with_the_front_among_them() -> None:
    found = np.array(drawn_views(9, np.random.default_rng(0)))
    assert found.shape == (9, 2)
    assert tuple(found[0]) == FRONT
    assert (np.abs(found) <= [10, 5]).all()
    first = found[:4]
    assert min(np.linalg.norm(a - b) for i, a in enumerate(first) for b in first[:i]) >= 5
    published = drawn_views(9, np.random.default_rng(0), published=True)
    assert published[0] == (10.0, 5.0)
    again = drawn_views(9, np.random.default_rng(0))
    assert np.array_equal(found, again)
