"""The points of a regular finer grid, as places between cells."""

from itertools import product

import numpy as np

from vnca.typing import FloatArray, IntArray


def subdivided(cells: IntArray, neighbours: IntArray, factor: int) -> tuple[IntArray, FloatArray]:
    """Where the centres of the parts of some cells lie, cell by cell, z fastest.

    Args:
        cells: `[m]` rows of the cells.
        neighbours: `[27, n]` rows of the state around each cell; n where nothing lives.
        factor: Parts along each axis of a cell.

    Returns:
        Rows `[8, m · factor³]` of the cells around each centre, and `[m · factor³, 3]` how far it
        lies from the first of them to the last.
    """
    corners = np.array(list(product((0, 1), repeat=3)))
    parts = np.array(list(product(range(factor), repeat=3)))
    twice = 2 * parts + 1 - factor  # from the centre of the cell, in halves of a part
    lower = np.where(twice < 0, -1, 0)
    fractions = (twice / (2 * factor) - lower).astype(np.float32)
    around = lower + corners[:, None]  # [8, factor³, 3] offsets of neighbours
    numbers = (around + 1) @ np.array([9, 3, 1])  # in the order of `OFFSETS`
    rows = neighbours[numbers[:, None, :], cells[:, None]]
    return rows.reshape(len(corners), -1), np.tile(fractions, (len(cells), 1))
