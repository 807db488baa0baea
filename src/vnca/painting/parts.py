"""What a state shows, part of a cell by part: colours, and factors of density."""

from collections.abc import Callable
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.direction.mixing import Answer, Parts
from vnca.engine import Compute
from vnca.painting.state import Ready, RollState
from vnca.rule.paint import (
    Between,
    colour_means,
    colours,
    density_factors,
    density_means,
    parts_of_cells,
)


def parts_of(
    state: RollState,
    ready: Ready,
    finer: int,
    strength: Callable[[AnyArray], Answer],
    compute: Compute,
) -> Parts:
    """What a rule paints by itself.

    Of a decoder, each is the mean over a part of a cell: what is finer than the grid of the
    painting would be grain on it.

    Args:
        state: After the steps of a frame.
        ready: Its cells, and the rule.
        finer: Parts along each axis of a cell; 1 without a decoder.
        strength: How much of the change of density counts at places of the painting's grid.
        compute: How to decode.
    """
    if ready.rule.decoder is None:
        factors = density_factors(state.values[:-1], strength=strength(state.cells))
        return Parts(state.cells, colours(state.values[:-1]), factors)
    domain = ready.domain
    between = Between(ready.rule, compute.backend, threads=compute.threads)
    offsets = np.indices(3 * (finer,), np.int32).reshape(3, -1).T
    at = (state.cells[:, None] * finer + offsets).reshape(-1, 3)
    at = at.astype(np.int32, copy=False)
    strengths = strength(at)
    colour = np.empty((len(domain), *3 * (finer,), 3), np.float32)
    factors = np.empty(colour.shape[:-1], np.float32)
    for some, seen in parts_of_cells(between, state.values, domain, finer):
        colour[some] = colour_means(seen)
        factors[some] = density_means(seen, strength=_of_cells(strengths, some, finer))
    return Parts(at, colour.reshape(-1, 3), factors.reshape(-1))


def _of_cells(answer: Answer, some: slice, finer: int) -> Any:
    """An answer for all parts of cells, in some of the cells, beside the points in each part."""
    if isinstance(answer, (int, float)):
        return answer
    return answer.reshape(-1, *3 * (finer, 1))[some]
