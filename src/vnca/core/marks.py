"""Cells marked in bricks, a bit each, so that what lies beside them is found 64 cells at a time."""

from itertools import product

import numpy as np

from vnca.core import AnyArray, BoolArray, IntArray
from vnca.core.bricks import EDGE, Places

_ENDS = np.uint64(0x0101010101010101)
"""The lowest cell of each line along z."""
_ONE, _SEVEN = np.uint64(1), np.uint64(7)
_LINE, _REST = np.uint64(8), np.uint64(56)


def packed(marked: BoolArray) -> AnyArray:
    """Marks `[m, 8, 8, 8]` as bits: `[m, 8]`, a number a plane across x, a byte a line along z."""
    # A line along z is a byte, so nothing has to be told of axes, which is many times as quick.
    return np.packbits(marked.reshape(-1), bitorder="little").view("<u8").reshape(-1, EDGE)


def unpacked(bits: AnyArray) -> BoolArray:
    """The reverse of `packed`."""
    lines = np.ascontiguousarray(bits).reshape(-1).view(np.uint8)
    return np.unpackbits(lines, bitorder="little").view(np.bool_).reshape(-1, EDGE, EDGE, EDGE)


WAYS = tuple(product(range(3), (-1, 1)))
"""To the six neighbours of a cell, or of a brick: along which axis, and down or up."""


class Marks:
    """Finds what is marked beside the cells of some bricks; beyond the bricks nothing is.

    Attributes:
        rows_beside: `[m]` for each of `WAYS`, the number of the next brick; m where there is none.
    """

    def __init__(self, bricks: IntArray) -> None:
        """For bricks `[m, 3]`, sorted, each once."""
        places, one = Places(bricks), np.eye(3, dtype=np.int32)
        self.rows_beside: dict[tuple[int, int], AnyArray] = {
            way: places.find(bricks + way[1] * one[way[0]]) for way in WAYS
        }

    def next_to(self, bits: AnyArray, axis: int) -> AnyArray:
        """Where the next cell along an axis, up or down, is marked: `[m, 8]` bits."""
        below, above = (self._of_bricks(bits, axis, step) for step in (-1, 1))
        if axis == 0:
            along = np.concatenate([below[:, -1:], bits, above[:, :1]], axis=1)
            return along[:, :-2] | along[:, 2:]
        if axis == 1:
            return bits << _LINE | below >> _REST | bits >> _LINE | above << _REST
        low, high = _ENDS, _ENDS << _SEVEN
        up = (bits << _ONE) & ~low | (below >> _SEVEN) & low
        return up | (bits >> _ONE) & ~high | (above << _SEVEN) & high

    def _of_bricks(self, bits: AnyArray, axis: int, step: int) -> AnyArray:
        """The bits of the next bricks."""
        return np.append(bits, np.zeros((1, EDGE), bits.dtype), axis=0)[
            self.rows_beside[axis, step]
        ]

    def beside(self, bits: AnyArray) -> AnyArray:
        """Where one of a cell's six neighbours is marked: `[m, 8]` bits."""
        return self.next_to(bits, 0) | self.next_to(bits, 1) | self.next_to(bits, 2)

    def dilated(self, bits: AnyArray, cells: int) -> AnyArray:
        """Cells at most `cells` along each axis from a marked one: `[m, 8]` bits."""
        for axis in range(3):
            for _ in range(cells):
                bits = bits | self.next_to(bits, axis)
        return bits
