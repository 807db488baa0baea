"""Rollouts: the pool of states they start from and return to, and the memory they take.

A rollout keeps only some of its states for the gradient and computes the others again. Every step
has its number, from which its mask follows: computed again, it is the same to the bit.

Reference: Mordvintsev et al. 2020, "Growing Neural Cellular Automata", experiment 2 (the pool);
Griewank 1992, "Achieving logarithmic growth of temporal and spatial complexity in reverse automatic
differentiation"; one level of it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, inf, prod
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from vnca.core.errors import OptionError
from vnca.core.memory import free_memory, used_memory
from vnca.training import Snapshot, count, matched
from vnca.training.config import PoolConfig, TrainingConfig
from vnca.training.scenes import Scene


class Drawn(NamedTuple):
    """What an iteration starts from.

    Attributes:
        slot: In the pool.
        life: Number of that which the state leads.
        age: Rollouts that it has been through since it began with the seed.
        state: `[n + 1, C]`.
    """

    slot: int
    life: int
    age: int
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
        self._ages = [0] * config.size

    def draw(self, iteration: int) -> Drawn:
        """From a random slot.

        Every so many iterations, it is the seed again.
        """
        slot = int(self._random.integers(self._config.size))
        if iteration % self._config.reseed_every == 0:
            self._reseed(slot)
        state = self._states.get(slot, self._seed)
        return Drawn(slot, self._lives[slot], self._ages[slot], state)

    def put(self, slot: int, state: Tensor) -> bool:
        """Return a state; False if it had exploded and was replaced by the seed."""
        state = state.detach()
        if not self._is_sound(state):
            self._reseed(slot)
            return False
        self._states[slot] = state
        self._ages[slot] += 1
        return True

    def snapshot(self) -> Snapshot:
        """The states that are not the seed, by slot; not copied, for none is ever changed."""
        states = {str(slot): state for slot, state in self._states.items()}
        values = {"lives": [*self._lives], "begun": self._begun, "ages": [*self._ages]}
        return Snapshot(states, values)

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
        ages = [count(age, "age") for age in snapshot.values["ages"]]
        if not len(lives) == len(ages) == self._config.size:
            raise ValueError(f"lives: {len(lives)} in a pool of {self._config.size}")
        self._states, self._lives, self._begun, self._ages = states, lives, begun, ages

    def _reseed(self, slot: int) -> None:
        if self._states.pop(slot, None) is not None:
            self._lives[slot] = self._begun
            self._begun += 1
            self._ages[slot] = 0

    def _is_sound(self, state: Tensor) -> bool:
        # A NaN fails the comparison.
        return bool(state.abs().max() <= self._config.limit)


Advance = Callable[[Tensor, int], Tensor]
"""The state after the step of a number."""


def roll_out(
    advance: Advance, state: Tensor, steps: Sequence[int], *, kept_states: float = inf
) -> Tensor:
    """The state after the numbered steps; differentiable as if all states had been kept.

    Args:
        advance: A step, always the same for the same state and number.
        state: Where to begin.
        steps: Numbers of the steps.
        kept_states: How many may be kept at a time, `fewest_kept(len(steps))` or more.
    """
    length, kept = layout(len(steps), kept_states) if torch.is_grad_enabled() else (1, len(steps))
    through = _through(advance)
    again = len(steps) - kept
    for start in range(0, again, length):
        part = steps[start : min(start + length, again)]
        segment = checkpoint(through, state, part, use_reentrant=False, preserve_rng_state=False)
        assert isinstance(segment, Tensor)
        state = segment
    return through(state, steps[again:])


def layout(steps: int, room: float) -> tuple[int, int]:
    """How to keep at most `room` states and compute as few of them again as possible.

    The last steps, whose gradient is needed first, keep all of theirs. The others are parted into
    segments that keep their first: when its gradient is needed, a segment is computed again.

    Returns:
        The length of a segment, and how many steps at the end keep theirs.

    Raises:
        ValueError: If it takes more; see `fewest_kept`.
    """
    for kept in range(steps, -1, -1):
        for length in range(1, max(1, steps - kept) + 1):
            if ceil((steps - kept) / length) + max(kept, length - 1) <= room:
                return length, kept
    raise ValueError(f"{steps} steps cannot be computed again with room for {room} states")


def fewest_kept(steps: int) -> int:
    """The fewest states that `steps` steps can do with; it grows with their square root."""
    return min(ceil((steps - kept) / (kept + 1)) + kept for kept in range(steps))


def _through(advance: Advance) -> Callable[[Tensor, Sequence[int]], Tensor]:
    def through(state: Tensor, steps: Sequence[int]) -> Tensor:
        for step in steps:
            state = advance(state, step)
        return state

    return through


PIXEL_BYTES = 6000
"""A pixel of a picture, once in colour and once in grey, with all that a network computes from it.
Measured at 128² and 256² pixels: EfficientNet 5,700 bytes, VGG16 3,100 to 4,800."""
SAMPLE_BYTES = {"cpu": 30, "cuda": 130}
"""A sample on a pixel's ray, if the smoke's box fills the picture. Measured at 32³ and 64³ cells,
128² and 192² pixels; what a GPU runs was measured on the CPU."""
CELL_BYTES = 150
"""A cell with what is computed from its colour and density, beside states."""
BOX_BYTES = 100
"""A cell of the box around them, in dense grids."""
STATES_AT_WORK = 5
"""States beside those of the pool and the rollout: gradients, penalties, the one put back. This and
the two above: measured at 48³ and 64³ cells, together 390 to 630 bytes a cell of 12 channels."""
MARGIN = 1.1
"""What was measured is at most so much more than what this foretells."""


@dataclass(frozen=True)
class MemoryNeeds:
    """About how many bytes training takes beside what it holds before it begins.

    Attributes:
        pool: The pool, once it is full.
        state: A state of a rollout that is kept for the gradient, with its mask.
        pictures: What is computed from pictures.
        work: All else.
    """

    pool: int
    state: int
    pictures: int
    work: int

    @property
    def beside_rollout(self) -> int:
        """All but the states of the rollout."""
        return self.pool + self.pictures + self.work


def memory_needs(scenes: Sequence[Scene[Any]], config: TrainingConfig) -> MemoryNeeds:
    """About how much memory training takes on some scenes, by turns."""
    each = [_needs_of(scene, config) for scene in scenes]
    return MemoryNeeds(
        pool=sum(needs.pool for needs in each),
        state=max(needs.state for needs in each),
        pictures=max(needs.pictures for needs in each),
        work=sum(needs.work for needs in each),
    )


def _needs_of(scene: Scene[Any], config: TrainingConfig) -> MemoryNeeds:
    cells, box = len(scene.domain), scene.domain.box
    state = cells * config.rule.channels * 4
    mask = cells * config.rule.update_probability * 4
    sample = SAMPLE_BYTES["cpu" if scene.priors.device.type == "cpu" else "cuda"]
    seen, appearance = config.pictures, config.appearance
    pixel = PIXEL_BYTES * (appearance.colour + appearance.grey)
    pixel += (1 + appearance.shows_density) * scene.samples * sample
    return MemoryNeeds(
        pool=config.pool.size * state,
        state=round(state + mask),
        pictures=round(seen.count * seen.size**2 * pixel),
        work=cells * CELL_BYTES + prod(box.shape) * BOX_BYTES + STATES_AT_WORK * state,
    )


def states_to_keep(
    scenes: Sequence[Scene[Any]], config: TrainingConfig, budget: int | None
) -> float:
    """How many states of a rollout may be kept at a time; infinity if memory is no matter.

    Args:
        scenes: What is trained on.
        config: The hyperparameters.
        budget: Bytes for the whole program, or all its tensors on a GPU; by default what it has
            and what is free. Where even that does not seem to be enough, the fewest states are
            tried.

    Raises:
        OptionError: If the budget given is not enough.
    """
    device = scenes[0].priors.device
    used, needs = memory_used(device), memory_needs(scenes, config)
    free = memory_free(device) if budget is None else budget - used
    room = (free / MARGIN - needs.beside_rollout) / needs.state
    fewest = fewest_kept(config.longest_rollout)
    if room >= fewest:
        return room
    if budget is None:
        return fewest
    least = used + MARGIN * (needs.beside_rollout + fewest * needs.state)
    raise OptionError(
        f"`memory_budget` {_size(budget)}: at least {_size(least)} are needed here: {_size(used)} "
        f"are in use already, and training takes {_listed(needs, config, fewest)}"
    )


def memory_advice(scenes: Sequence[Scene[Any]], config: TrainingConfig, kept: float) -> str:
    """What takes how much memory, and what would take less, in one line.

    `kept` is the number of states that rollouts may keep.
    """
    needs, seen, longest = memory_needs(scenes, config), config.pictures, config.longest_rollout
    kept, fewest = min(longest, kept), fewest_kept(longest)
    pool, pixels = max(1, config.pool.size // 2), max(32, seen.size // 2)
    savings = {
        f"`pool.size` {pool}": needs.pool * (1 - pool / config.pool.size),
        "a `memory_budget`": (kept - fewest) * needs.state,
        f"`{seen.option}` {pixels}": needs.pictures * (1 - (pixels / seen.size) ** 2),
    }
    best = max(savings, key=lambda option: savings[option])
    cells = sum(len(scene.domain) for scene in scenes)
    return (
        f"for {cells} cells training takes {_listed(needs, config, kept)}; "
        f"{best} would take up to {_size(savings[best])} less"
    )


def memory_used(device: torch.device) -> int:
    """Bytes that this program has now, 0 where that cannot be known; on a GPU, those of tensors."""
    if device.type == "cuda":
        return torch.cuda.memory_allocated(device)
    return used_memory()


def memory_free(device: torch.device) -> float:
    """Bytes that it may have beside, as the system says; infinity where it does not say."""
    if device.type == "cuda":
        kept_for_tensors = torch.cuda.memory_reserved(device) - torch.cuda.memory_allocated(device)
        return torch.cuda.mem_get_info(device)[0] + kept_for_tensors
    return free_memory()


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an allocation failed: torch says so in an error that has no class of its own."""
    told = str(error)
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError)
        and any(
            words in told for words in ("allocate memory", "not enough memory", "out of memory")
        )
    )


def _listed(needs: MemoryNeeds, config: TrainingConfig, kept: float) -> str:
    """What takes how much memory if rollouts keep so many states."""
    taken = {
        f"`pool.size` {config.pool.size}": needs.pool,
        f"`longest_rollout` {config.longest_rollout}": kept * needs.state,
        f"`{config.pictures.option}` {config.pictures.size}": needs.pictures,
        "the cells": needs.work,
    }
    return ", ".join(f"{what} about {_size(bytes_)}" for what, bytes_ in taken.items())


def _size(bytes_: float) -> str:
    return f"{bytes_ / 1e9:.1f} GB" if bytes_ >= 1e9 else f"{bytes_ / 1e6:.0f} MB"
