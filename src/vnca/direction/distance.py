"""How far cells lie from others, exactly, up to a limit."""

from dataclasses import replace

import numpy as np

from vnca.core.field import Field


def distances(to: Field, most: int) -> Field:
    """The Euclidean distance of each cell's centre to the nearest of some cells, in cells.

    Args:
        to: Zero at those cells, infinite at others, float32; also outside.
        most: What is farther away is said to be so far.

    Reference: Felzenszwalb and Huttenlocher 2012: the squares are found axis by axis.
    """
    field = to
    for axis in range(3):
        nearest, up, down = field.values.copy(), field, field
        for step in range(1, most + 1):
            up = replace(field, values=up.shifted(axis, 1))
            down = replace(field, values=down.shifted(axis, -1))
            beside = np.minimum(up.values, down.values)
            np.minimum(nearest, beside + np.float32(step**2), out=nearest)
        field = replace(field, values=nearest)
    return replace(
        field,
        values=np.minimum(np.sqrt(field.values), np.float32(most)),
        outside=np.float32(min(most, float(to.outside))),
    )
