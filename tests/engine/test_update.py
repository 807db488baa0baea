"""The reference step against a literal transcription of the paper's equations."""

import itertools

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from vnca.core import AnyArray, Box
from vnca.engine.automaton import OFFSETS, Weights, changing_rows, hash_cells, stencil
from vnca.engine.domain import Domain
from vnca.engine.reference.equations import update

CHANNELS, HIDDEN, PRIORS = 4, 6, 3


def random_weights(generator: torch.Generator, dtype: torch.dtype) -> Weights:
    def draw(*shape: int) -> Tensor:
        return 0.3 * torch.randn(*shape, generator=generator, dtype=dtype)

    return Weights(draw(HIDDEN, 5 * CHANNELS + PRIORS), draw(HIDDEN), draw(CHANNELS, HIDDEN))


def dense_step(grid: Tensor, priors: Tensor, alive: Tensor, chosen: Tensor, w: Weights) -> Tensor:
    """The step as the field writes it: padded convolutions over a whole `[x, y, z, c]` grid."""
    filters = torch.as_tensor(stencil(), dtype=grid.dtype).view(5, 1, 3, 3, 3)
    volume = grid.permute(3, 0, 1, 2)[:, None]
    padded = functional.pad(volume, (1,) * 6, mode="replicate")
    z = functional.conv3d(padded, filters)  # [c, 5, x, y, z]
    z = z.permute(2, 3, 4, 1, 0).flatten(3)
    hidden = torch.relu(torch.cat([z, priors], dim=-1) @ w.hidden.T + w.bias)
    return grid + (alive & chosen)[..., None] * (hidden @ w.output.T)


def listed(dense: AnyArray, domain: Domain) -> AnyArray:
    """Values `[n, ...]` at the cells of a domain, of an array that begins where its box does."""
    return dense[tuple((domain.cells - np.asarray(domain.box.lower)).T)]


@pytest.mark.parametrize("shape", [(1, 1, 1), (5, 4, 3), (9, 17, 8)])
@pytest.mark.parametrize("occupancy", [0.4, 1.0])
def test_a_step_equals_the_dense_equations(shape: tuple[int, int, int], occupancy: float) -> None:
    generator = torch.Generator().manual_seed(3)
    alive = torch.rand(*shape, generator=generator) <= occupancy
    alive[0, 0, 0] = True
    domain = Domain.from_mask(alive.numpy(), (-7, 2, 30))
    weights = random_weights(generator, torch.float64)
    grid = torch.randn(*shape, CHANNELS, generator=generator, dtype=torch.float64)
    grid *= alive[..., None]
    priors = torch.randn(*shape, PRIORS, generator=generator, dtype=torch.float64)
    rows = changing_rows(domain.hashes, seed=1, step=5, probability=0.5)
    chosen = torch.zeros(shape, dtype=torch.bool)
    chosen[tuple(torch.as_tensor((domain.cells[rows] - domain.box.lower).T.astype(np.int64)))] = 1

    state = torch.as_tensor(listed(grid.numpy(), domain))
    state = torch.cat([state, torch.zeros(1, CHANNELS, dtype=torch.float64)])
    got = update(
        state,
        torch.as_tensor(rows),
        torch.as_tensor(domain.neighbours),
        torch.as_tensor(listed(priors.numpy(), domain)),
        weights,
        torch.as_tensor(stencil(), dtype=torch.float64),
    )
    expected = dense_step(grid, priors, alive, chosen, weights)
    assert torch.all(got[-1] == 0)
    torch.testing.assert_close(
        torch.as_tensor(domain.scatter(got[:-1].numpy(), domain.box)), expected
    )


def test_gradients_equal_finite_differences() -> None:
    generator = torch.Generator().manual_seed(0)
    alive = torch.rand(4, 3, 3, generator=generator) < 0.7
    domain = Domain.from_mask(alive.numpy(), (0, 0, 0))
    n = len(domain)
    state = torch.randn(n + 1, CHANNELS, generator=generator, dtype=torch.float64)
    state[-1] = 0
    inside = state[:-1].clone().requires_grad_()
    weights = [w.requires_grad_() for w in random_weights(generator, torch.float64)]
    priors = torch.randn(n, PRIORS, generator=generator, dtype=torch.float64)
    rows = torch.arange(0, n, 2, dtype=torch.int32)
    filters = torch.as_tensor(stencil(), dtype=torch.float64)
    neighbours = torch.as_tensor(domain.neighbours)

    def two_steps(inside: Tensor, *weights: Tensor) -> Tensor:
        state = torch.cat([inside, inside.new_zeros(1, CHANNELS)])
        for _ in range(2):
            state = update(state, rows, neighbours, priors, Weights(*weights), filters)
        return state[:-1]

    assert torch.autograd.gradcheck(two_steps, (inside, *weights))


def test_filters_are_exact_on_a_ramp_and_on_a_paraboloid() -> None:
    filters = stencil().astype(np.float64)
    ramps = OFFSETS.astype(np.float64)
    np.testing.assert_allclose(filters[1:4] @ ramps, np.eye(3), atol=1e-7)
    np.testing.assert_allclose(filters[4] @ ramps, 0, atol=1e-6)
    np.testing.assert_allclose(filters[4] @ (ramps**2).sum(axis=1), 6, rtol=1e-6)
    np.testing.assert_allclose(filters.sum(axis=1), [1, 0, 0, 0, 0], atol=1e-6)


def test_the_mask_of_a_cell_does_not_depend_on_the_grid_around_it() -> None:
    whole = Domain.from_mask(np.ones((6, 5, 9), bool), (-3, 0, 7))
    part = Domain.from_mask(np.ones((2, 5, 4), bool), (-1, 0, 9))

    def chosen(domain: Domain) -> set[tuple[int, ...]]:
        rows = changing_rows(domain.hashes, seed=11, step=3, probability=0.5)
        return {tuple(cell) for cell in domain.cells[rows].tolist()}

    inside = {tuple(cell) for cell in part.cells.tolist()}
    assert chosen(part) == chosen(whole) & inside


def test_the_mask_is_fair_and_independent_between_steps_seeds_and_neighbours() -> None:
    cells = np.array(list(itertools.product(range(24), repeat=3)), dtype=np.int32)
    hashes = hash_cells(cells)

    def draw(seed: int, step: int) -> np.ndarray:
        mask = np.zeros(len(cells), bool)
        mask[changing_rows(hashes, seed=seed, step=step, probability=0.5)] = True
        return mask

    sigma = 0.5 / np.sqrt(len(cells))
    reference = draw(0, 0)
    assert abs(reference.mean() - 0.5) < 4 * sigma
    for other in (draw(0, 1), draw(1, 0), draw(2**31, 7)):
        assert abs((reference ^ other).mean() - 0.5) < 4 * sigma
    cube = reference.reshape(24, 24, 24)
    for axis in range(3):
        agreement = np.diff(cube.astype(int), axis=axis) != 0
        assert abs(agreement.mean() - 0.5) < 5 * sigma
    quarter = changing_rows(hashes, seed=0, step=0, probability=0.25)
    assert abs(len(quarter) / len(cells) - 0.25) < 4 * sigma


def test_a_grid_cut_into_tiles_with_halos_gives_the_same_bits() -> None:
    generator = torch.Generator().manual_seed(5)
    weights = random_weights(generator, torch.float32)
    filters = torch.as_tensor(stencil())
    whole = Domain.from_mask(np.ones((8, 6, 6), bool), (0, 0, 0))
    tile = Domain.from_mask(np.ones((5, 6, 6), bool), (0, 0, 0), box=Box((0, 0, 0), (8, 6, 6)))
    state = torch.randn(len(whole), CHANNELS, generator=generator)

    def step(domain: Domain) -> Tensor:
        dense = whole.scatter(state.numpy(), whole.box)
        own = torch.as_tensor(listed(dense, domain))
        rows = changing_rows(domain.hashes, seed=0, step=0, probability=0.5)
        result = update(
            torch.cat([own, torch.zeros(1, CHANNELS)]),
            torch.as_tensor(rows),
            torch.as_tensor(domain.neighbours),
            torch.zeros(len(domain), PRIORS),
            weights,
            filters,
        )
        return torch.as_tensor(domain.scatter(result[:-1].numpy(), whole.box))

    # The tile's last layer is its halo: it sees nothing beyond and is recomputed by the next tile.
    torch.testing.assert_close(step(tile)[:4], step(whole)[:4], rtol=0, atol=0)
