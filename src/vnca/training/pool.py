"""States that rollouts start from and return to, so that rules learn to live long.

Reference: Mordvintsev et al. 2020, "Growing Neural Cellular Automata", experiment 2.
"""

from typing import NamedTuple

import numpy as np
from torch import Tensor

from vnca.training.config import PoolConfig
from vnca.training.snapshot import Snapshot, count, matched


class Drawn(NamedTuple):
    """What an iteration starts from.

    Attributes:
        slot: In the pool.
        life: Number of that which the state leads.
        state: `[n + 1, C]`.
    """

    slot: int
    life: int
    state: Tensor


class Pool:
    """A fixed number of states; all start from the seed.

    A state's life is from one seed in its slot to the next. Lives are numbered; that a slot begins
    with has the slot's number.
    """

    def __init__(self, seed: Tensor, config: PoolConfig, random: np.random.Generator) -> None:
        """Fill the pool with `seed`, `[n + 1, C]`."""
        self._seed = seed
        self._config = config
        self._random = random
        self._states: dict[int, Tensor] = {}  # those that are not the seed
        self._lives = list(range(config.size))
        self._begun = config.size

    def draw(self, iteration: int) -> Drawn:
        """From a random slot.

        Every so many iterations, it is the seed again.
        """
        slot = int(self._random.integers(self._config.size))
        if iteration % self._config.reseed_every == 0:
            self._reseed(slot)
        return Drawn(slot, self._lives[slot], self._states.get(slot, self._seed))

    def put(self, slot: int, state: Tensor) -> bool:
        """Return a state; False if it had exploded and was replaced by the seed."""
        state = state.detach()
        if not self._is_sound(state):
            self._reseed(slot)
            return False
        self._states[slot] = state
        return True

    def snapshot(self) -> Snapshot:
        """The states that are not the seed, by slot; not copied, for none is ever changed."""
        states = {str(slot): state for slot, state in self._states.items()}
        return Snapshot(states, {"lives": [*self._lives], "begun": self._begun})

    def restore(self, snapshot: Snapshot) -> None:
        """Hold the states of a snapshot; which are drawn is up to the random stream.

        Raises:
            ValueError: If it is not one of such a pool.
        """
        states = {}
        for name, state in snapshot.tensors.items():
            slot = count(int(name), "slot", most=self._config.size - 1)
            states[slot] = matched(state, self._seed, f"state {name}")
            if not self._is_sound(state):
                raise ValueError(f"state {name}: beyond the limit")
        begun = count(snapshot.values["begun"], "lives")
        lives = [count(life, "life", most=begun - 1) for life in snapshot.values["lives"]]
        if len(lives) != self._config.size:
            raise ValueError(f"lives: {len(lives)} in a pool of {self._config.size}")
        self._states, self._lives, self._begun = states, lives, begun

    def _reseed(self, slot: int) -> None:
        if self._states.pop(slot, None) is not None:
            self._lives[slot] = self._begun
            self._begun += 1

    def _is_sound(self, state: Tensor) -> bool:
        # A NaN fails the comparison.
        return bool(state.abs().max() <= self._config.limit)
