import numpy as np
import pytest
import torch

from vnca.training.config import PoolConfig
from vnca.training.rollout import Pool

SEED = torch.zeros(5, 4)
NEVER = 10**9


def pool(size: int = 4, reseed_every: int = NEVER, limit: float = 4.0) -> Pool:
    return Pool(SEED, PoolConfig(size, reseed_every, limit), np.random.default_rng(0))


def test_every_state_starts_as_the_seed() -> None:
    states = pool()
    assert all(states.draw(1).state is SEED for _ in range(20))


def test_a_state_that_was_returned_is_drawn_again_without_its_gradient() -> None:
    states = pool(size=1)
    slot = states.draw(1).slot
    grown = torch.full_like(SEED, 0.5, requires_grad=True)
    assert states.put(slot, grown * 2)
    again = states.draw(2).state
    assert torch.equal(again, torch.ones_like(SEED))
    assert not again.requires_grad


def test_slots_do_not_share_a_state() -> None:
    states = pool(size=8)
    slot = states.draw(1).slot
    states.put(slot, torch.ones_like(SEED))
    for drawn in (states.draw(2) for _ in range(50)):
        other, state = drawn.slot, drawn.state
        assert torch.equal(state, torch.ones_like(SEED) if other == slot else SEED)


def test_every_so_many_iterations_the_seed_is_drawn_and_its_old_state_forgotten() -> None:
    states = pool(size=1, reseed_every=8)
    states.put(0, torch.ones_like(SEED))
    assert bool(states.draw(7).state.any())
    assert not states.draw(8).state.any()
    assert not states.draw(9).state.any()


@pytest.mark.parametrize("value", [4.5, -4.5, float("nan"), float("inf")])
def test_an_exploded_state_is_thrown_away(value: float) -> None:
    states = pool(size=1)
    states.put(0, torch.ones_like(SEED))
    exploded = torch.zeros_like(SEED)
    exploded[2, 3] = value
    assert not states.put(0, exploded)
    assert not states.draw(1).state.any()


def test_all_slots_are_drawn() -> None:
    states = pool(size=8)
    assert {states.draw(1).slot for _ in range(200)} == set(range(8))


def test_each_seed_begins_a_life_that_no_state_has_led() -> None:
    states = pool(size=2, reseed_every=10)
    lives = []
    for iteration in range(1, 60):
        drawn = states.draw(iteration)
        states.put(drawn.slot, torch.ones_like(SEED))
        lives.append(drawn.life)
    assert set(lives[:9]) == {0, 1}
    assert set(lives) == set(range(2 + 5))


def test_lives_go_on_from_a_snapshot() -> None:
    states, again = pool(size=2, reseed_every=2), pool(size=2, reseed_every=2)
    for iteration in range(1, 9):
        states.put(states.draw(iteration).slot, torch.ones_like(SEED))
    again.restore(states.snapshot())
    again._random = np.random.default_rng()
    again._random.bit_generator.state = states._random.bit_generator.state
    assert [states.draw(i)[:3] for i in range(9, 30)] == [again.draw(i)[:3] for i in range(9, 30)]


def test_a_state_is_as_old_as_the_rollouts_since_its_seed() -> None:
    states = pool(size=1, reseed_every=8)
    ages = []
    for iteration in range(1, 18):
        ages.append(states.draw(iteration).age)
        states.put(0, torch.ones_like(SEED))
    assert ages == [*range(7), *range(8), 0, 1]
    states.put(0, torch.full_like(SEED, float("nan")))
    assert states.draw(1).age == 0
    with pytest.raises(ValueError, match="lives"):
        pool(size=3).restore(states.snapshot())
