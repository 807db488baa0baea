"""States that rollouts start from and return to, so that rules learn to live long.

Reference: Mordvintsev et al. 2020, "Growing Neural Cellular Automata", experiment 2.
"""

import numpy as np
from torch import Tensor

from vnca.training.config import PoolConfig
from vnca.training.snapshot import Snapshot, count, matched


class Pool:
    """A fixed number of states; all start from the seed."""

    def __init__(self, seed: Tensor, config: PoolConfig, random: np.random.Generator) -> None:
        """Fill the pool with `seed`, `[n + 1, C]`."""
        self._seed = seed
        self._config = config
        self._random = random
        self._states: dict[int, Tensor] = {}  # those that are not the seed

    def draw(self, iteration: int) -> tuple[int, Tensor]:
        """A random slot in the pool and its state; every so many iterations, the seed again."""
        slot = int(self._random.integers(self._config.size))
        if iteration % self._config.reseed_every == 0:
            self._states.pop(slot, None)
        return slot, self._states.get(slot, self._seed)

    def put(self, slot: int, state: Tensor) -> bool:
        """Return a state; False if it had exploded and was replaced by the seed."""
        state = state.detach()
        if not self._is_sound(state):
            self._states.pop(slot, None)
            return False
        self._states[slot] = state
        return True

    def snapshot(self) -> Snapshot:
        """The states that are not the seed, by slot; not copied, for none is ever changed."""
        return Snapshot({str(slot): state for slot, state in self._states.items()})

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
        self._states = states

    def _is_sound(self, state: Tensor) -> bool:
        # A NaN fails the comparison.
        return bool(state.abs().max() <= self._config.limit)
