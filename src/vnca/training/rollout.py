"""A rollout that keeps only some of its states for the gradient, and computes the others again.

Every step has its number, from which its mask follows: computed again, it is the same to the bit.

Reference: Griewank 1992, "Achieving logarithmic growth of temporal and spatial complexity in
reverse automatic differentiation"; one level of it.
"""

from collections.abc import Callable, Sequence
from math import ceil, inf

import torch
from torch import Tensor
from torch.utils.checkpoint import checkpoint

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
