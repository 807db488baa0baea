"""Values between cells, where not every cell has one."""

from itertools import product

import numpy as np

from vnca.typing import AnyArray, BoolArray

_LEAST_SHARE = 1e-6


def interpolated(
    values: AnyArray, known: BoolArray, places: AnyArray
) -> tuple[AnyArray, BoolArray]:
    """Values interpolated linearly between the known ones of the eight cells around each place.

    The shares of known cells are scaled to add up to one: a constant stays what it is up to where
    the last known cell ends.

    Args:
        values: `[x, y, z, c]`.
        known: `[x, y, z]`, which cells have a value.
        places: `[n, 3]`, in cells from the centre of cell `[0, 0, 0]`; beyond the outermost
            centres the outermost cells count.

    Returns:
        `[n, c]` float64, zero where nothing near is known, and where something is, `[n]`.
    """
    last = np.array(known.shape) - 1
    places = np.clip(places, 0, last)
    below = places.astype(np.intp)
    fraction = places - below
    flat_values, flat_known = values.reshape(-1, values.shape[-1]), known.reshape(-1)
    total, weight = np.zeros((len(places), values.shape[-1])), np.zeros(len(places))
    for corner in product((0, 1), repeat=3):
        cell = np.ravel_multi_index(tuple(np.minimum(below + corner, last).T), known.shape)
        share = np.where(corner, fraction, 1 - fraction).prod(axis=1) * flat_known[cell]
        total += share[:, None] * flat_values[cell]
        weight += share
    is_known = weight > _LEAST_SHARE
    total[is_known] /= weight[is_known, None]
    total[~is_known] = 0
    return total, is_known
