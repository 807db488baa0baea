"""How the strokes of a style's picture run, before any guide turns them."""

from collections.abc import Iterable

import numpy as np

from vnca.core import AnyArray
from vnca.direction.colour.oklab import oklab

_CLEARLY = 0.5
"""By how much of all changes of colour more go across than down, where strokes stand: much, as a
picture that has both (0.27 for the café) is not painted with strokes that do."""


def strokes_stand(pictures: Iterable[AnyArray]) -> bool:
    """Whether strokes run upright rather than level; those that run every way do not.

    A rule learns its picture from all sides, so that what leans to the left from one of them leans
    to the right from the other: strokes of its pattern are level or upright on the whole.

    Args:
        pictures: All that a rule paints of, linear RGB `[r, c, 3]`.

    Reference: Förstner and Gülch 1987: the trace of the mean structure tensor, axis by axis.
    """
    right = below = 0.0
    for colours in map(oklab, pictures):
        across, down = np.diff(colours, axis=1), np.diff(colours, axis=0)
        # Both in the middle of four pixels, so that fine strokes are as steep both ways.
        right += float(np.square(across[1:] + across[:-1]).sum())
        below += float(np.square(down[:, 1:] + down[:, :-1]).sum())
    return right - below > _CLEARLY * (right + below)
