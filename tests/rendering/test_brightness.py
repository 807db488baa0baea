import numpy as np
import pytest
import torch

from vnca.rendering.march import paper_composite
from vnca.rule import gamma_for_cell_opacity, gamma_for_own_colour


@pytest.mark.parametrize("opacity", [0.15, 0.95])
def test_a_cell_of_even_smoke_is_as_opaque_as_asked(opacity: float) -> None:
    density = np.zeros((6, 5, 4), np.float32)
    density[2:4] = 0.3
    gamma = gamma_for_cell_opacity(density, opacity)
    assert 1 - np.exp(-gamma * 0.3) == pytest.approx(opacity)


def test_faint_fringes_and_units_do_not_change_the_picture() -> None:
    core = np.full(100, 2.0)
    faint = np.full(10_000, 1e-4)
    alone = gamma_for_cell_opacity(core, 0.9)
    assert gamma_for_cell_opacity(np.append(core, faint), 0.9) == pytest.approx(alone, rel=0.01)
    assert gamma_for_cell_opacity(10 * core, 0.9) == pytest.approx(alone / 10)


def test_without_smoke_any_gamma_will_do() -> None:
    assert gamma_for_cell_opacity(np.zeros((2, 0, 3), np.float32), 0.9) == 1
    assert gamma_for_own_colour(np.zeros((2, 0, 3), np.float32)) == 1


@pytest.mark.parametrize("density", [0.2, 1.0, 3.0])
def test_by_the_papers_integrand_even_smoke_is_as_bright_as_its_colour(density: float) -> None:
    gamma = gamma_for_own_colour(np.full((4, 5), density))
    ray, colour = torch.full((1, 200), density), torch.full((1, 200, 3), 0.6)
    seen, opacity = paper_composite(ray, colour, gamma=gamma)
    assert seen[0].tolist() == pytest.approx([0.6] * 3, rel=1e-4)
    assert opacity.item() == pytest.approx(1)
    # What suits emission and absorption is nearly black here.
    dark, _ = paper_composite(ray, colour, gamma=gamma_for_cell_opacity(ray.numpy(), 0.95))
    assert dark.max() < 0.25 * density
