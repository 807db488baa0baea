"""What an automaton is, wherever it is computed: weights, perception, mask and decoder.

The mask of a cell is a hash of nothing but the seed, the step and the cell's index coordinates, so
that every backend draws the same. A grid cut into tiles, a grid that grows and a run that restarts
therefore all see the same one.

Reference: VNCA section 3.3 (Sobel and 27-point Laplacian, after O'Reilly and Beck 2006); the mask's
finaliser is Wellons' `lowbias32` (2018), a 32-bit bijection of low bias.
"""

import itertools
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vnca.core import FloatArray, IntArray

NEIGHBOURS = 27
FILTERS = 5
"""Identity, gradient along x, y and z, Laplacian."""

OFFSETS: IntArray = np.array(list(itertools.product((-1, 0, 1), repeat=3)), dtype=np.int32)
"""`[27, 3]` offsets of a cell's neighbours (itself is number 13), z fastest."""
HashArray = NDArray[np.uint32]


def stencil(*, sobel_divisor: float = 32.0, laplacian_divisor: float = 26.0) -> FloatArray:
    """Weights `[5, 27]` of identity, Sobel x, y, z and Laplacian over `OFFSETS`.

    With the default divisors the gradient of a unit ramp is exactly 1 and the Laplacian of r²
    exactly 6.
    """
    smooth = np.array([1, 2, 1])[OFFSETS + 1]
    distance = np.abs(OFFSETS).sum(axis=1)
    identity = (distance == 0).astype(np.float64)
    sobel_x = OFFSETS[:, 0] * smooth[:, 1] * smooth[:, 2] / sobel_divisor
    sobel_y = OFFSETS[:, 1] * smooth[:, 0] * smooth[:, 2] / sobel_divisor
    sobel_z = OFFSETS[:, 2] * smooth[:, 0] * smooth[:, 1] / sobel_divisor
    laplacian = np.array([-88, 6, 3, 2])[distance] / laplacian_divisor
    return np.stack([identity, sobel_x, sobel_y, sobel_z, laplacian]).astype(np.float32)


class Weights(NamedTuple):
    """The trained weights of a rule: numpy arrays, or tensors where they are being trained.

    Attributes:
        hidden: W1 `[hidden, 5C + P]`.
        bias: b1 `[hidden]`.
        output: W2 `[C, hidden]`.
    """

    hidden: Any
    bias: Any
    output: Any


@dataclass(frozen=True, eq=False)
class Automaton:
    """All that a step depends on beside state and surroundings.

    Attributes:
        weights: W1, b1 and W2.
        stencil: `[5, 27]` filters of perception.
        update_probability: Chance of a cell to change in a step.
        seed: Of the update mask.
    """

    weights: Weights
    stencil: FloatArray
    update_probability: float
    seed: int

    def slowed(self, times: int) -> "Automaton":
        """One whose steps change cells so many times less."""
        if times == 1:
            return self
        weights = self.weights._replace(output=self.weights.output / np.float32(times))
        return replace(self, weights=weights)


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


OUTPUTS = 4
"""What is seen: colour (3) as sRGB − ½, and Δd; added to the first channels of the state."""

CORNERS = 8
"""Cells around a point, z fastest."""


class DecoderWeights(NamedTuple):
    """Of three sine layers and a linear one; arrays, tensors, or whatever there is for each.

    The frequency by which a sine layer is customarily multiplied is part of its weights and bias.

    Attributes:
        first: `[H, C]`, from the state.
        first_bias: `[H]`.
        second: `[H, H]`.
        second_bias: `[H]`.
        third: `[H, H]`.
        third_bias: `[H]`.
        output: `[4, H]`.
        output_bias: `[4]`.
    """

    first: Any
    first_bias: Any
    second: Any
    second_bias: Any
    third: Any
    third_bias: Any
    output: Any
    output_bias: Any

    @classmethod
    def shapes(cls, channels: int, units: int) -> "DecoderWeights":
        """The shape of each."""
        square, bias = (units, units), (units,)
        return cls(
            (units, channels), bias, square, bias, square, bias, (OUTPUTS, units), (OUTPUTS,)
        )
