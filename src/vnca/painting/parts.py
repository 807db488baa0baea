"""What a state shows, part of a cell by part: colours, and factors of density."""

from collections.abc import Callable

import numpy as np

from vnca.core import AnyArray
from vnca.direction.mixing import Answer, Parts
from vnca.engine import Compute
from vnca.painting.state import Ready, RollState
from vnca.rule.paint import Between, colours, density_factors


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
    colour, change = between.parts(state.values, domain, finer)
    return Parts(at, colour.reshape(-1, 3), 1 + strength(at) * change.reshape(-1))
