"""Growing what is marked in a field, cell by cell."""

from dataclasses import replace

import numpy as np

from vnca.core.bricks.field import Field
from vnca.core.bricks.places import EDGE, bricks_beside


def dilated(marked: Field, reach: int) -> Field:
    """Cells at most `reach` cells along each axis from one in a field of booleans, in its box."""
    bricks = bricks_beside(marked.bricks, -(-reach // EDGE))
    grown = replace(marked, bricks=bricks, values=marked.blocks(bricks))
    for axis in range(3):
        for _ in range(reach):
            ahead, behind = grown.shifted(axis, 1), grown.shifted(axis, -1)
            np.logical_or(grown.values, np.logical_or(ahead, behind, out=ahead), out=grown.values)
    return grown.within(marked.box).trimmed()
