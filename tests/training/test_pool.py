import numpy as np
import pytest
import torch

from vnca.training.config import PoolConfig
from vnca.training.pool import Pool

SEED = torch.zeros(5, 4)
NEVER = 10**9


def pool(size: int = 4, reseed_every: int = NEVER, limit: float = 4.0) -> Pool:
    return Pool(SEED, PoolConfig(size, reseed_every, limit), np.random.default_rng(0))


def test_every_state_starts_as_the_seed() -> None:
    states = pool()
    assert all(states.draw(1)[1] is SEED for _ in range(20))


def test_a_state_that_was_returned_is_drawn_again_without_its_gradient() -> None:
    states = pool(size=1)
    slot, _ = states.draw(1)
    grown = torch.full_like(SEED, 0.5, requires_grad=True)
    assert states.put(slot, grown * 2)
    _, again = states.draw(2)
    assert torch.equal(again, torch.ones_like(SEED))
    assert not again.requires_grad


def test_places_do_not_share_a_state() -> None:
    states = pool(size=8)
    slot, _ = states.draw(1)
    states.put(slot, torch.ones_like(SEED))
    for other, state in (states.draw(2) for _ in range(50)):
        assert torch.equal(state, torch.ones_like(SEED) if other == slot else SEED)


def test_every_so_many_iterations_the_seed_is_drawn_and_its_old_state_forgotten() -> None:
    states = pool(size=1, reseed_every=8)
    states.put(0, torch.ones_like(SEED))
    assert bool(states.draw(7)[1].any())
    assert not states.draw(8)[1].any()
    assert not states.draw(9)[1].any()


@pytest.mark.parametrize("value", [4.5, -4.5, float("nan"), float("inf")])
def test_an_exploded_state_is_thrown_away(value: float) -> None:
    states = pool(size=1)
    states.put(0, torch.ones_like(SEED))
    exploded = torch.zeros_like(SEED)
    exploded[2, 3] = value
    assert not states.put(0, exploded)
    assert not states.draw(1)[1].any()


def test_all_places_are_drawn() -> None:
    states = pool(size=8)
    assert {states.draw(1)[0] for _ in range(200)} == set(range(8))
