"""Means and covariances of feature sets."""

import numpy as np
import pytest
import torch

from vnca.losses.moments import moment_distance, moments


def features(count: int, channels: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(count, channels, generator=generator, dtype=torch.float64)


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


def test_gradient_is_that_of_the_value() -> None:
    style = moments(features(9, 3, seed=1))
    x = features(6, 3, seed=0).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: moment_distance(moments(x), style), (x,))


def test_one_position_has_finite_gradients() -> None:
    x = torch.ones(1, 3, requires_grad=True)
    moment_distance(moments(x), moments(torch.zeros(1, 3))).backward()
    assert x.grad is not None
    assert torch.isfinite(x.grad).all()
