"""The palette: which colours occur."""

import math

import pytest
import torch

from vnca.losses.pixels import luma, palette_distance, to_yuv


def pixels(count: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, 3, generator=generator, dtype=torch.float64)


def test_agrees_with_the_definition() -> None:
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


def test_gradient_is_that_of_the_value() -> None:
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
