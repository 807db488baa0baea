"""What every layer speaks in: aliases for arrays, and boxes of cells."""

from operator import add
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float32]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int32]
AnyArray: TypeAlias = NDArray[Any]
Index: TypeAlias = tuple[int, int, int]


class Box(NamedTuple):
    """A half-open box of cells in index space: `lower <= index < upper`."""

    lower: Index
    upper: Index

    @property
    def shape(self) -> Index:
        """Cells along x, y and z; zero where the box is empty or inverted."""
        x, y, z = (max(0, high - low) for low, high in zip(self.lower, self.upper, strict=True))
        return x, y, z

    @property
    def is_empty(self) -> bool:
        """Whether the box holds no cell."""
        return 0 in self.shape

    def union(self, other: "Box") -> "Box":
        """The smallest box around both; an empty box adds nothing."""
        if other.is_empty:
            return self
        if self.is_empty:
            return other
        return Box(_each(min, self.lower, other.lower), _each(max, self.upper, other.upper))

    def intersection(self, other: "Box") -> "Box":
        """The cells in both boxes, possibly none."""
        return Box(_each(max, self.lower, other.lower), _each(min, self.upper, other.upper))

    def grown(self, cells: int) -> "Box":
        """The box with a margin of `cells` added on every side."""
        x, y, z = self.lower
        u, v, w = self.upper
        return Box((x - cells, y - cells, z - cells), (u + cells, v + cells, w + cells))

    def moved(self, by: Index) -> "Box":
        """The box so many cells farther along each axis."""
        return Box(_each(add, self.lower, by), _each(add, self.upper, by))

    def refined(self, factor: int) -> "Box":
        """The same region in cells `factor` times as fine along each axis."""
        x, y, z = (factor * low for low in self.lower)
        u, v, w = (factor * high for high in self.upper)
        return Box((x, y, z), (u, v, w))

    def coarsened(self, factor: int) -> "Box":
        """The cells `factor` times as wide that hold those of the box."""
        x, y, z = (low // factor for low in self.lower)
        u, v, w = (-(-high // factor) for high in self.upper)
        return Box((x, y, z), (u, v, w))

    def slices(self, inside: "Box") -> tuple[slice, slice, slice]:
        """Where this box lies in an array that covers `inside`."""
        x, y, z = (
            slice(low - start, high - start)
            for low, high, start in zip(self.lower, self.upper, inside.lower, strict=True)
        )
        return x, y, z


def _each(pick: Any, a: Index, b: Index) -> Index:
    x, y, z = (pick(i, j) for i, j in zip(a, b, strict=True))
    return x, y, z
