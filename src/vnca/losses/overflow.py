"""Keeps the cell state in a range in which the automaton stays stable."""

from jaxtyping import Float
from torch import Tensor


def overflow(state: Float[Tensor, "*cells c"]) -> Float[Tensor, ""]:
    """Mean distance of the state's values from the interval −1 to 1; differentiable.

    Reference: Niklasson et al. 2021 (the overflow loss of texture automata).
    """
    return (state - state.clamp(-1, 1)).abs().mean()
