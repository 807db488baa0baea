import pytest
import torch

from vnca.peers.transport import (
    blurred,
    curl,
    divergence,
    gradient,
    maccormack,
    places,
    pulled,
    resized,
    sample,
    semi_lagrangian,
)

SHAPE = (18, 20, 22)


def gaussian(centre: tuple[float, float, float], sigma: float = 1.7) -> torch.Tensor:
    at = places(SHAPE, torch.zeros(1))
    return torch.exp(-(at - torch.tensor(centre)).square().sum(-1) / (2 * sigma**2))


def centroid(field: torch.Tensor) -> torch.Tensor:
    at = places(SHAPE, field)
    return (field[..., None] * at).sum((0, 1, 2)) / field.sum()


def constant(*velocity: float) -> torch.Tensor:
    return torch.tensor(velocity).expand(*SHAPE, 3)


@pytest.mark.parametrize("carry", [semi_lagrangian, maccormack])
def test_a_gaussian_moves_by_a_constant_velocity(carry) -> None:
    start = gaussian((8.0, 9.0, 10.0))
    moved = carry(start, constant(0.7, -0.4, 1.3))
    shift = centroid(moved) - centroid(start)
    assert torch.allclose(shift, torch.tensor([0.7, -0.4, 1.3]), atol=3e-2)


def test_pulling_looks_where_the_flow_points_to_and_is_linear() -> None:
    start = gaussian((8.0, 9.0, 10.0))
    flow = constant(0.5, 0.0, -1.0)
    shift = centroid(pulled(start, flow)) - centroid(start)
    assert torch.allclose(shift, torch.tensor([-0.5, 0.0, 1.0]), atol=2e-3)
    other = torch.rand(SHAPE, generator=torch.Generator().manual_seed(0))
    both = pulled(2 * start + other, flow)
    assert torch.allclose(both, 2 * pulled(start, flow) + pulled(other, flow), atol=1e-6)


@pytest.mark.parametrize("carry", [semi_lagrangian, maccormack, pulled])
def test_nothing_moves_where_nothing_flows(carry) -> None:
    field = torch.rand(SHAPE, generator=torch.Generator().manual_seed(1))
    assert torch.allclose(carry(field, constant(0.0, 0.0, 0.0)), field, atol=1e-5)


def test_the_correction_sharpens_and_its_limiter_invents_no_extremes() -> None:
    flow = constant(0.5, 0.5, 0.5)
    start = gaussian((8.0, 9.0, 10.0), 1.5)
    once = semi_lagrangian(start, flow)
    twice = maccormack(start, flow)
    exact = gaussian((8.5, 9.5, 10.5), 1.5)
    assert (twice - exact).square().sum() < 0.4 * (once - exact).square().sum()
    block = torch.zeros(SHAPE)
    block[6:12, 6:12, 6:12] = 1
    carried = maccormack(block, flow)
    assert carried.min() >= 0
    assert carried.max() <= 1
    # Without a limiter of its own place, published code lets it overshoot or drops it.
    published = maccormack(block, flow, limits_by_centre=True)
    assert not torch.allclose(published, carried, atol=1e-3)


def test_a_curl_is_free_of_divergence_to_rounding() -> None:
    random = torch.Generator().manual_seed(2)
    potential = torch.randn(*SHAPE, 3, generator=random, dtype=torch.float64)
    assert divergence(curl(potential)).abs().max() < 1e-13
    assert divergence(potential).abs().max() > 0.1


def test_the_gradient_of_a_ramp_is_its_slope() -> None:
    ramp = places(SHAPE, torch.zeros(1)) @ torch.tensor([1.0, -2.0, 0.5])
    assert torch.allclose(gradient(ramp), constant(1.0, -2.0, 0.5), atol=1e-5)
    assert divergence(gradient(ramp)).abs().max() < 1e-5


def test_values_between_cells_are_trilinear_and_go_on_beyond_or_end() -> None:
    ramp = places(SHAPE, torch.zeros(1))[..., 0]
    at = torch.tensor([[[[2.25, 3.0, 4.0], [-5.0, 3.0, 4.0]]]])
    assert torch.allclose(sample(ramp, at).flatten(), torch.tensor([2.25, 0.0]), atol=1e-4)
    assert sample(ramp + 1, at, outside="zeros").flatten()[1] == 0


def test_resizing_keeps_a_ramp_and_the_mass() -> None:
    ramp = places((16, 16, 16), torch.zeros(1))[..., 2] + 0.5
    half = resized(ramp, (8, 8, 8))
    assert torch.allclose(
        half[2:-2, 2:-2, 2:-2] / 2,
        (places((8, 8, 8), ramp)[..., 2] + 0.5)[2:-2, 2:-2, 2:-2],
        atol=1e-3,
    )
    blob = blurred(torch.nn.functional.pad(torch.ones(4, 4, 4), [6] * 6), 1.0)
    assert resized(blob, (8, 8, 8)).sum() * 8 == pytest.approx(float(blob.sum()), rel=0.02)
    assert resized(blob, (16, 16, 16)) is blob


def test_blurring_keeps_the_sum_and_does_nothing_without_width() -> None:
    field = torch.zeros(SHAPE)
    field[9, 9, 9] = 1
    soft = blurred(field, 1.2)
    assert soft.sum() == pytest.approx(1.0, abs=1e-5)
    assert soft[9, 9, 9] == pytest.approx((2 * torch.pi * 1.44) ** -1.5, rel=0.05)
    assert blurred(field, 0.0) is field
