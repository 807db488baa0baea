"""What an automaton is, wherever it is computed."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from vnca.core.typing import FloatArray


class Weights(NamedTuple):
    """The trained weights of a rule: numpy arrays, or tensors where they are being trained.

    Attributes:
        hidden: W1 `[hidden, 5C + P]`.
        bias: b1 `[hidden]`.
        output: W2 `[C, hidden]`.
    """

    hidden: Any
    bias: Any
    output: Any


@dataclass(frozen=True, eq=False)
class Automaton:
    """All that a step depends on beside state and surroundings.

    Attributes:
        weights: W1, b1 and W2.
        stencil: `[5, 27]` filters of perception.
        update_probability: Chance of a cell to change in a step.
        seed: Of the update mask.
    """

    weights: Weights
    stencil: FloatArray
    update_probability: float
    seed: int
