"""Each term of the loss against values known by hand or by another way, and its gradients."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import wasserstein_distance
from torch.nn import functional

from vnca.losses import (
    cosine_cost,
    luma,
    moment_distance,
    moments,
    ordered,
    overflow,
    palette_distance,
    sample_positions,
    sliced_distance,
    style_distance,
    to_yuv,
    unit_vectors,
)


def features(count: int, channels: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(count, channels, generator=generator, dtype=torch.float64)


def distance_by_loops(x: torch.Tensor, y: torch.Tensor) -> float:
    def cost(a: list[float], b: list[float]) -> float:
        inner = sum(i * j for i, j in zip(a, b, strict=True))
        return 1 - inner / math.hypot(*a) / math.hypot(*b)

    def one_way(these: list[list[float]], those: list[list[float]]) -> float:
        return sum(min(cost(a, b) for b in those) for a in these) / len(these)

    return max(one_way(x.tolist(), y.tolist()), one_way(y.tolist(), x.tolist()))


@settings(deadline=None, max_examples=30)
@given(
    n=st.integers(1, 8), m=st.integers(1, 8), c=st.integers(1, 5), seed=st.integers(0, 2**31 - 1)
)
def test_style_agrees_with_the_definition(n: int, m: int, c: int, seed: int) -> None:
    # Of one length: beside zero, where directions have no meaning, the distance is smoothed.
    x, y = (functional.normalize(features(k, c, s)) for k, s in ((n, seed), (m, seed + 1)))
    assert style_distance(x, y).item() == pytest.approx(distance_by_loops(x, y), abs=1e-6)


def test_identical_sets_are_at_distance_zero() -> None:
    x = features(50, 16, seed=0)
    assert style_distance(x, x).item() == pytest.approx(0, abs=1e-12)
    assert sliced(x, x.flip(0)) == pytest.approx(0, abs=1e-12)


def sliced(x: torch.Tensor, y: torch.Tensor, slices: int = 32) -> float:
    directions = unit_vectors(x.shape[1], slices, torch.Generator().manual_seed(0)).to(x)
    return sliced_distance(x, directions, ordered(y, directions)).item()


@settings(deadline=None, max_examples=30)
@given(n=st.integers(1, 40), times=st.integers(1, 4), seed=st.integers(0, 2**31 - 1))
def test_sliced_distance_of_numbers_is_that_of_earth_movers(n: int, times: int, seed: int) -> None:
    x, y = features(n, 1, seed), features(n, 1, seed + 1)
    expected = wasserstein_distance(x[:, 0].numpy(), y[:, 0].numpy())
    assert sliced(x, y) == pytest.approx(expected, abs=1e-9)
    # Of unlike numbers of vectors, quantiles are compared.
    assert sliced(x, x.repeat(times, 1)) <= 2 * float(x.max() - x.min()) / n + 1e-9


def test_sliced_distance_of_a_shift() -> None:
    x = features(200, 3, seed=0)
    # The mean length of a unit vector of three dimensions along a random direction is a half.
    assert sliced(x, x + torch.tensor([0.0, 4.0, 0.0]), 4000) == pytest.approx(2, rel=0.03)


def test_shares_of_colours_count_in_slices_alone() -> None:
    grey, white = torch.full((1, 3), 0.2), torch.ones(1, 3)
    many, few = (torch.cat([grey.repeat(n, 1), white.repeat(20 - n, 1)]) for n in (18, 2))
    assert palette_distance(many, few).item() < 0.02
    assert sliced(to_yuv(many), to_yuv(few)) > 0.2


def test_few_quantiles_of_a_set_tell_nearly_all_of_it() -> None:
    x, y = features(70, 5, seed=0), features(400, 5, seed=1)
    directions = unit_vectors(5, 20, torch.Generator().manual_seed(2))
    torch.testing.assert_close(directions.norm(dim=0), torch.ones(20))
    directions = directions.double()
    known, few = ordered(y, directions), ordered(y, directions, 100)
    assert (known.diff(dim=0) >= 0).all()
    assert len(few) == 100
    expected = sliced_distance(x, directions, known)
    torch.testing.assert_close(sliced_distance(x, directions, few), expected, rtol=0.01, atol=0)


def test_sliced_distance_has_the_right_gradients() -> None:
    x, y = (features(n, 4, seed=n).requires_grad_() for n in (6, 9))

    def distance(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        directions = unit_vectors(4, 5, torch.Generator().manual_seed(0)).to(x)
        return sliced_distance(x, directions, ordered(y, directions))

    assert torch.autograd.gradcheck(distance, (x, y))


def test_lengths_of_vectors_do_not_matter() -> None:
    x = features(50, 16, seed=0)
    assert style_distance(x, 3 * x).item() == pytest.approx(0, abs=1e-12)


def test_order_does_not_matter() -> None:
    x, y = features(40, 8, seed=1), features(30, 8, seed=2)
    order = torch.randperm(40, generator=torch.Generator().manual_seed(3))
    torch.testing.assert_close(style_distance(x[order], y), style_distance(x, y))


def test_both_directions_count() -> None:
    few = torch.eye(4, dtype=torch.float64)[:1]
    many = torch.eye(4, dtype=torch.float64)
    # Every vector of `few` is found in `many`, three of four not the other way round.
    assert style_distance(few, many).item() == pytest.approx(0.75)
    assert style_distance(many, few).item() == pytest.approx(0.75)


def test_gradient_of_style_is_that_of_the_value() -> None:
    x = features(7, 5, seed=4).requires_grad_()
    y = features(6, 5, seed=5).requires_grad_()
    assert torch.autograd.gradcheck(style_distance, (x, y))


def test_zero_vectors_have_finite_gradients() -> None:
    x = torch.zeros(5, 8, requires_grad=True)
    style_distance(x, torch.zeros(3, 8)).backward()
    assert x.grad is not None
    assert torch.isfinite(x.grad).all()


def test_zero_vectors_cost_one() -> None:
    assert cosine_cost(torch.zeros(1, 3), torch.ones(1, 3)).item() == 1


def test_positions_are_drawn_without_repetition_and_by_the_seed() -> None:
    first = sample_positions(1000, 100, torch.Generator().manual_seed(0))
    again = sample_positions(1000, 100, torch.Generator().manual_seed(0))
    other = sample_positions(1000, 100, torch.Generator().manual_seed(1))
    assert len(set(first.tolist())) == 100
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


def test_few_positions_are_all_taken() -> None:
    generator = torch.Generator().manual_seed(0)
    assert sample_positions(7, 7, generator).tolist() == list(range(7))


def test_agree_with_numpy() -> None:
    x = features(30, 4, seed=0)
    mean, covariance = moments(x)
    np.testing.assert_allclose(mean, x.numpy().mean(0))
    np.testing.assert_allclose(covariance, np.cov(x.numpy(), rowvar=False, bias=True))


def test_distance_agrees_with_the_definition() -> None:
    a, b = moments(features(30, 4, seed=0)), moments(features(20, 4, seed=1))
    expected = sum(abs(float(a.mean[i] - b.mean[i])) for i in range(4)) / 4
    expected += (
        sum(abs(float(a.covariance[i, j] - b.covariance[i, j])) for i in range(4) for j in range(4))
        / 16
    )
    assert moment_distance(a, b).item() == pytest.approx(expected)


def test_order_and_repetition_do_not_matter() -> None:
    x = features(30, 4, seed=0)
    same = torch.cat([x.flip(0), x])
    assert moment_distance(moments(x), moments(same)).item() == pytest.approx(0, abs=1e-12)


def test_a_stronger_contrast_is_noticed() -> None:
    x = features(30, 4, seed=0)
    assert moment_distance(moments(x), moments(2 * x)).item() > 0.1


def test_gradient_of_moments_is_that_of_the_value() -> None:
    style = moments(features(9, 3, seed=1))
    x = features(6, 3, seed=0).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: moment_distance(moments(x), style), (x,))


def test_one_position_has_finite_gradients() -> None:
    x = torch.ones(1, 3, requires_grad=True)
    moment_distance(moments(x), moments(torch.zeros(1, 3))).backward()
    assert x.grad is not None
    assert torch.isfinite(x.grad).all()


def pixels(count: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, 3, generator=generator, dtype=torch.float64)


def test_the_palette_agrees_with_the_definition() -> None:
    x, y = pixels(6, seed=0), pixels(5, seed=1)

    def cost(a: list[float], b: list[float]) -> float:
        inner = sum(i * j for i, j in zip(a, b, strict=True))
        return math.dist(a, b) + 1 - inner / math.hypot(*a) / math.hypot(*b)

    a, b = to_yuv(x).tolist(), to_yuv(y).tolist()
    there = sum(min(cost(i, j) for j in b) for i in a) / len(a)
    back = sum(min(cost(i, j) for i in a) for j in b) / len(b)
    assert palette_distance(x, y).item() == pytest.approx(max(there, back), abs=1e-6)


def test_the_same_colours_elsewhere_are_near() -> None:
    x = pixels(40, seed=0)
    # The root of a distance of zero is held off zero, for its gradient.
    assert palette_distance(x, x.flip(0)).item() == pytest.approx(0, abs=2e-4)


def test_a_missing_colour_is_noticed() -> None:
    grey = torch.full((10, 3), 0.5)
    with_red = torch.cat([grey, torch.tensor([[1.0, 0, 0]]).expand(10, 3)])
    assert palette_distance(grey, with_red).item() > 0.3


def test_gradient_of_the_palette_is_that_of_the_value() -> None:
    x = pixels(6, seed=0).requires_grad_()
    y = pixels(5, seed=1).requires_grad_()
    assert torch.autograd.gradcheck(palette_distance, (x, y))


def test_equal_and_black_pixels_have_finite_gradients() -> None:
    x = torch.zeros(4, 3, requires_grad=True)
    palette_distance(x, torch.zeros(4, 3)).backward()
    assert x.grad is not None
    assert torch.isfinite(x.grad).all()


def test_grey_keeps_white_and_the_order_of_brightness() -> None:
    picture = torch.zeros(1, 3, 1, 4)
    picture[0, :, 0, 0] = 1
    for channel in range(3):
        picture[0, channel, 0, 1 + channel] = 1
    white, red, green, blue = luma(picture)[0, :, 0].T
    assert white.tolist() == pytest.approx([1, 1, 1])
    assert green[0] > red[0] > blue[0] > 0
    assert red.unique().numel() == 1


def test_states_within_the_range_cost_nothing() -> None:
    assert overflow(torch.tensor([[-1.0, 0.0, 1.0]])).item() == 0


def test_the_excess_is_averaged() -> None:
    assert overflow(torch.tensor([[3.0, -1.5], [0.0, 0.5]])).item() == pytest.approx(2.5 / 4)


def test_gradient_points_back_into_the_range() -> None:
    state = torch.tensor([2.0, -2.0, 0.5], requires_grad=True)
    overflow(state).backward()
    assert state.grad is not None
    torch.testing.assert_close(state.grad, torch.tensor([1.0, -1.0, 0.0]) / 3)
