import numpy as np
import pytest
import torch

from vnca.core import colour as plain
from vnca.rendering import colour

CURVES = ["srgb_to_linear", "linear_to_srgb"]


@pytest.mark.parametrize("name", CURVES)
def test_twins_agree(name) -> None:
    value = np.linspace(-1, 3, 4001)
    found = getattr(colour, name)(torch.from_numpy(value)).numpy()
    np.testing.assert_allclose(found, getattr(plain, name)(value), rtol=1e-12)


@pytest.mark.parametrize("name", CURVES)
def test_gradients_are_finite_in_the_dark(name) -> None:
    value = torch.tensor([-1.0, -1e-30, 0.0, 1e-30, 0.001, 1.0, 2.0], requires_grad=True)
    getattr(colour, name)(value).sum().backward()
    assert value.grad is not None
    assert (value.grad > 0).all()
    assert value.grad.isfinite().all()


def test_luminance_agrees() -> None:
    rgb = np.random.default_rng(0).random((4, 5, 3))
    found = colour.luminance(torch.from_numpy(rgb)).numpy()
    np.testing.assert_allclose(found, plain.luminance(rgb))
