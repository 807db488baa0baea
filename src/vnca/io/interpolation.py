"""Values between cells, where not every cell has one."""

from itertools import product

import numpy as np

from vnca.typing import AnyArray, BoolArray, FloatArray

_LEAST_SHARE = 1e-6


def interpolated(
    values: FloatArray, known: BoolArray, places: AnyArray
) -> tuple[FloatArray, BoolArray]:
    """Values interpolated linearly between the known ones of the eight cells around each place.

    The shares of known cells are scaled to add up to one: a constant stays what it is up to where
    the last known cell ends.

    Args:
        values: `[x, y, z, c]`.
        known: `[x, y, z]`, which cells have a value.
        places: `[n, 3]`, in cells from the centre of cell `[0, 0, 0]`; beyond the outermost
            centres the outermost cells count.

    Returns:
        `[n, c]`, zero where nothing near is known, and where something is, `[n]`.
    """
    shape = np.array(known.shape)
    places = np.clip(places, 0, shape - 1)
    below = np.minimum(places.astype(np.intp), np.maximum(shape - 2, 0))
    upper = (places - below).astype(np.float32).T
    shares = (1 - upper, upper)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    # An axis of one cell has no cell above: the share of it is none.
    first, steps = below @ strides, strides * (shape > 1)
    flat_values, flat_known = values.reshape(-1, values.shape[-1]), known.reshape(-1)
    total = np.zeros((len(places), values.shape[-1]), np.float32)
    weight = np.zeros(len(places), np.float32)
    for i, j, k in product((0, 1), repeat=3):
        cells = first + int(np.dot((i, j, k), steps))
        share = shares[i][0] * shares[j][1] * shares[k][2]
        share *= flat_known.take(cells)
        total += share[:, None] * flat_values.take(cells, axis=0)
        weight += share
    is_known = weight > _LEAST_SHARE
    total /= np.where(is_known, weight, 1)[:, None]
    total[~is_known] = 0
    return total, is_known
