import pytest
import torch

from vnca.peers.splat import Splatter, cubic_spline, gathered, splatted_mass
from vnca.peers.transport import places

SHAPE = (10, 11, 12)


def scattered(count: int = 4000) -> torch.Tensor:
    random = torch.rand(count, 3, generator=torch.Generator().manual_seed(0))
    return random * (torch.tensor(SHAPE) - 1)


@pytest.mark.parametrize("width", [1.0, 2.0])
def test_splat_of_gather_of_a_constant_is_constant_inside(width: float) -> None:
    at = torch.cat([scattered(), places(SHAPE, torch.zeros(1)).reshape(-1, 3)])
    values = gathered(torch.full(SHAPE, 0.7), at)
    assert torch.allclose(values, torch.tensor(0.7), atol=1e-5)
    assert torch.allclose(Splatter(at, SHAPE, width)(values), torch.tensor(0.7), atol=1e-5)


def test_particles_outside_reach_nothing_and_cells_without_any_are_empty() -> None:
    found = Splatter(torch.tensor([[-9.0, 0, 0], [5.0, 5.0, 5.0]]), SHAPE, 2.0)(torch.ones(2))
    assert found[5, 5, 5] > 0.5
    assert found[0, 0, 0] == 0
    assert found[9, 10, 11] == 0
    assert (found > 0).sum() <= 27


def test_the_kernel_is_monaghans() -> None:
    q = torch.tensor([0.0, 0.25, 0.5, 0.75, 1.0, 1.5])
    expected = torch.tensor([1.0, 0.71875, 0.25, 0.03125, 0.0, 0.0])
    assert torch.allclose(cubic_spline(q), expected)


def test_gathering_is_exact_at_cells_and_on_quadratics() -> None:
    at = places(SHAPE, torch.zeros(1))
    field = 0.1 * at[..., 0] ** 2 + at[..., 1] - at[..., 2]
    cells = torch.tensor([[3.0, 4.0, 5.0], [0.0, 10.0, 11.0]])
    assert torch.allclose(gathered(field, cells), torch.tensor([0.9 - 1, 0 - 1.0]), atol=1e-5)
    between = torch.tensor([[3.4, 4.2, 5.7]])
    assert gathered(field, between).item() == pytest.approx(0.1 * 3.4**2 + 4.2 - 5.7, abs=1e-4)
    both = gathered(torch.stack([field, -field], -1), between)
    assert torch.allclose(both[:, 0], -both[:, 1])


def test_a_particle_a_cell_is_a_mass_of_one() -> None:
    at = places(SHAPE, torch.zeros(1)).reshape(-1, 3)
    mass = splatted_mass(at, SHAPE, 2.0)
    assert torch.allclose(mass[1:-1, 1:-1, 1:-1], torch.tensor(1.0), atol=1e-5)
    crowded = splatted_mass(torch.cat([at, at]), SHAPE, 2.0)
    assert torch.allclose(crowded, 2 * mass)


def test_splatting_passes_gradients_to_values_and_mass_to_positions() -> None:
    at = scattered(200).double().requires_grad_()
    values = torch.rand(200, dtype=torch.float64, requires_grad=True)
    splat = Splatter(at.detach(), SHAPE, 2.0)
    assert torch.autograd.gradcheck(lambda v: splat(v)[4:6, 4:6, 4:6], values)
    (slope,) = torch.autograd.grad(splatted_mass(at, SHAPE, 2.0).square().sum(), at)
    assert slope.abs().max() > 0
