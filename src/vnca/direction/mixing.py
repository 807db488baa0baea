"""Mixing that is exact: at either end it is that end, and equals give themselves."""

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, FloatArray, IntArray
from vnca.core.field import Field

Answer: TypeAlias = float | FloatArray
"""A number that holds everywhere, or one for each place, `[n]`."""


def mixed(first: Answer, second: Answer, share: Answer) -> Answer:
    """From `first` at a share of 0 to `second` at 1, straight in between."""
    between = first + share * (second - first)
    if isinstance(between, float):
        return second if share == 1 else between
    return np.where(np.equal(share, 1), second, between).astype(np.float32, copy=False)


def eased(part: Any) -> Any:
    """3t² − 2t³: from 0 to 1, at rest at both ends."""
    return part * part * (3 - 2 * part)


def per_colour(answer: Answer) -> Answer:
    """The same beside colours `[n, 3]`."""
    return answer if isinstance(answer, (int, float)) else answer[:, None]


class Parts(NamedTuple):
    """What is painted, place by place.

    Attributes:
        at: `[n, 3]` index coordinates on the grid of the painting, each once.
        colour: `[n, 3]`, linear RGB.
        factors: `[n]`, what the density is multiplied by.
    """

    at: IntArray
    colour: FloatArray
    factors: FloatArray


def layered(below: Parts, above: Parts, share: Answer) -> Parts:
    """One painting over another; where only one of them has a place, it is that one.

    Args:
        below: The one.
        above: The other.
        share: Of the other, at the places of the one.
    """
    rows, is_there = _rows(above.at, below.at)
    share = np.where(is_there, np.float32(share), np.float32(0))
    alone = np.ones(len(above.at), bool)
    alone[rows[is_there]] = False
    # A row of the one's own stands for what is not there.
    colour, factors = below.colour.copy(), below.factors.copy()
    colour[is_there], factors[is_there] = (
        above.colour[rows[is_there]],
        above.factors[rows[is_there]],
    )
    return Parts(
        np.concatenate([below.at, above.at[alone]]),
        np.concatenate([mixed(below.colour, colour, share[:, None]), above.colour[alone]]),
        np.concatenate([mixed(below.factors, factors, share), above.factors[alone]]),
    )


def _rows(cells: IntArray, wanted: IntArray) -> tuple[AnyArray, BoolArray]:
    """Which of some cells each wanted one is, and whether it is one."""
    if np.array_equal(cells, wanted):
        return np.arange(len(cells)), np.ones(len(cells), bool)
    corner = cells.min(axis=0, initial=2**31 - 1), cells.max(axis=0, initial=-(2**31))
    box = Box(*(tuple(map(int, each)) for each in corner))  # type: ignore[arg-type]
    rows = Field.from_cells(cells, np.arange(len(cells)), box, outside=len(cells)).gather(wanted)
    return rows, rows < len(cells)
