"""Which cells may change in a step: a hash, so that every backend draws the same mask.

The mask of a cell depends on nothing but the seed, the step and the cell's index coordinates.
A grid cut into tiles, a grid that grows and a run that restarts therefore all see the same one.

Reference: the finaliser is Wellons' `lowbias32` (2018), a 32-bit bijection of low bias.
"""

import numpy as np
from numpy.typing import NDArray

from vnca.typing import IntArray

HashArray = NDArray[np.uint32]


def mix(value: HashArray) -> HashArray:
    """Scramble 32-bit integers; a bijection in which each input bit flips half the output bits."""
    value = value ^ (value >> np.uint32(16))
    value = value * np.uint32(0x7FEB352D)
    value ^= value >> np.uint32(15)
    value *= np.uint32(0x846CA68B)
    value ^= value >> np.uint32(16)
    return value


def hash_cells(cells: IntArray) -> HashArray:
    """Hash `[n]` of index coordinates `[n, 3]`, computed once for a domain."""
    x, y, z = np.ascontiguousarray(cells.T, dtype=np.int32).view(np.uint32)
    return mix(x + mix(y + mix(z)))


def changing_rows(cell_hashes: HashArray, *, seed: int, step: int, probability: float) -> IntArray:
    """Rows `[m]` of the cells that change in this step, each with the given probability.

    Args:
        cell_hashes: `[n]` from `hash_cells`.
        seed: Any integer; its low 32 bits count.
        step: Steps since the state was seeded.
        probability: Chance of a cell to change, in (0, 1].
    """
    if probability >= 1:
        return np.arange(len(cell_hashes), dtype=np.int32)
    chosen = mix(cell_hashes ^ mask_key(seed, step)) < mask_threshold(probability)
    return np.flatnonzero(chosen).astype(np.int32)


def mask_key(seed: int, step: int) -> np.uint32:
    """What the hashes of all cells are combined with in a step."""
    words = np.array([seed & 0xFFFFFFFF, step & 0xFFFFFFFF], dtype=np.uint32)
    return mix(words[:1] + mix(words[1:]))[0]


def mask_threshold(probability: float) -> np.uint32:
    """The hash from which a cell does not change, for a probability between 0 and 1.

    At least one hash changes and one does not, however near to 0 or 1 the probability.
    """
    return np.uint32(min(max(round(probability * 2**32), 1), 2**32 - 1))
