"""States that rollouts start from and return to, so that rules learn to live long.

Reference: Mordvintsev et al. 2020, "Growing Neural Cellular Automata", experiment 2.
"""

import numpy as np
from torch import Tensor

from vnca.training.config import PoolConfig


class Pool:
    """A fixed number of states; all start from the seed."""

    def __init__(self, seed: Tensor, config: PoolConfig, random: np.random.Generator) -> None:
        """Fill the pool with `seed`, `[n + 1, C]`."""
        self._seed = seed
        self._config = config
        self._random = random
        self._states: dict[int, Tensor] = {}  # those that are not the seed

    def draw(self, iteration: int) -> tuple[int, Tensor]:
        """A random place in the pool and its state; every so many iterations, the seed again."""
        place = int(self._random.integers(self._config.size))
        if iteration % self._config.reseed_every == 0:
            self._states.pop(place, None)
        return place, self._states.get(place, self._seed)

    def put(self, place: int, state: Tensor) -> bool:
        """Return a state; False if it had exploded and was replaced by the seed."""
        state = state.detach()
        # A NaN fails the comparison and so counts as exploded.
        if not bool(state.abs().max() <= self._config.limit):
            self._states.pop(place, None)
            return False
        self._states[place] = state
        return True
