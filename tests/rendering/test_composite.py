import math

import pytest
import torch

from vnca.core.errors import ShapeError
from vnca.rendering.march import composite, paper_composite, ray_weights


def random_rays(rays: int = 5, samples: int = 12) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    density = torch.rand(rays, samples, generator=generator, dtype=torch.float64)
    colour = torch.rand(rays, samples, 3, generator=generator, dtype=torch.float64)
    return density, colour


@pytest.mark.parametrize("step", [1.0, 0.5, 0.1])
def test_slab_has_the_opacity_of_beer_and_lambert(step) -> None:
    gamma, density, length = 0.4, 0.7, 6.0
    extinction = torch.full((1, round(length / step)), gamma * density, dtype=torch.float64)
    colour = torch.tensor([0.2, 0.5, 0.9], dtype=torch.float64).expand(*extinction.shape, 3)
    pixel, opacity = composite(extinction, colour, step=step)
    expected = 1 - math.exp(-gamma * density * length)
    assert opacity.item() == pytest.approx(expected, rel=1e-12)
    torch.testing.assert_close(pixel[0] / opacity[0], colour[0, 0])


def test_weights_and_what_is_left_add_up_to_one() -> None:
    extinction, _ = random_rays()
    weights, left = ray_weights(extinction, step=0.7)
    torch.testing.assert_close(weights.sum(1) + left, torch.ones(5, dtype=torch.float64))


def test_nearer_smoke_hides_farther_smoke() -> None:
    extinction = torch.full((1, 2), 3.0)
    colour = torch.tensor([[[1.0, 0, 0], [0, 1.0, 0]]])
    pixel, _ = composite(extinction, colour, step=1.0)
    near = 1 - math.exp(-3)
    assert pixel[0].tolist() == pytest.approx([near, near * math.exp(-3), 0])


def test_thinnest_smoke_keeps_its_opacity_in_single_precision() -> None:
    weights, _ = ray_weights(torch.full((1, 1), 1e-10), step=1.0)
    assert weights.item() == pytest.approx(1e-10)


def test_composite_gradients_match_finite_differences() -> None:
    extinction, colour = random_rays(2, 5)
    inputs = (extinction.requires_grad_(), colour.requires_grad_())
    assert torch.autograd.gradcheck(lambda e, c: composite(e, c, step=0.7), inputs)
    assert torch.autograd.gradcheck(lambda e, c: paper_composite(e, c, gamma=0.3), inputs)


def test_paper_mode_is_the_printed_sum() -> None:
    density, colour = random_rays()
    gamma = 0.3
    pixel, opacity = paper_composite(density, colour, gamma=gamma)
    for ray in range(len(density)):
        expected = torch.zeros(3, dtype=torch.float64)
        absorbed = 0.0
        for d, c in zip(density[ray], colour[ray], strict=True):
            absorbed += gamma * d.item()
            expected += c * d * math.exp(-absorbed)
        torch.testing.assert_close(pixel[ray], expected)
        assert opacity[ray].item() == pytest.approx(1 - math.exp(-absorbed))


@pytest.mark.parametrize(
    "call", [lambda d, c: composite(d, c, step=1.0), lambda d, c: paper_composite(d, c, gamma=1.0)]
)
@pytest.mark.usefixtures("unchecked_shapes")
def test_colours_for_other_samples_are_refused(call) -> None:
    density, colour = random_rays()
    with pytest.raises(ShapeError, match="colour"):
        call(density, colour[:, 1:])
