"""Values between cells, where not every cell has one."""

from itertools import product

import numpy as np

from vnca.core.bricks.field import Field
from vnca.core.bricks.places import CELLS
from vnca.core.typing import AnyArray, BoolArray, FloatArray

_LEAST_SHARE = 1e-6


def interpolated(values: Field, known: Field, places: AnyArray) -> tuple[FloatArray, BoolArray]:
    """Values interpolated linearly between the known ones of the eight cells around each place.

    The shares of known cells are scaled to add up to one: a constant stays what it is up to where
    the last known cell ends.

    Args:
        values: `[..., c]`.
        known: Which cells of the same box have a value.
        places: `[n, 3]`, index coordinates; beyond the outermost centres of the box the outermost
            cells count.

    Returns:
        `[n, c]`, zero where nothing near is known, and where something is, `[n]`.
    """
    first, last = np.array(known.box.lower), np.array(known.box.upper) - 1
    places = np.clip(places, first, last)
    below = np.minimum(np.floor(places), np.maximum(last - 1, first)).astype(np.int32)
    upper = (places - below).astype(np.float32).T
    shares = (1 - upper, upper)
    # Laid out flat, with a brick of nothing behind the last.
    blocks = values.blocks(known.bricks)
    count = blocks.shape[-1]
    flat_values = np.concatenate([blocks.reshape(-1, count), np.zeros((CELLS, count), np.float32)])
    flat_known = np.concatenate([known.values.reshape(-1), np.zeros(CELLS, bool)])
    total = np.zeros((len(places), count), np.float32)
    weight = np.zeros(len(places), np.float32)
    for corner in product((0, 1), repeat=3):
        # An axis of one cell has no cell above: the share of it is none.
        cells = known.find(below + np.array(corner, np.int32) * (last > first))
        i, j, k = corner
        share = shares[i][0] * shares[j][1] * shares[k][2]
        share *= flat_known.take(cells)
        total += share[:, None] * flat_values.take(cells, axis=0)
        weight += share
    is_known = weight > _LEAST_SHARE
    total /= np.where(is_known, weight, 1)[:, None]
    total[~is_known] = 0
    return total, is_known
