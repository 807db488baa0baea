"""The weights of a decoder, whatever holds them."""

from typing import Any, NamedTuple

OUTPUTS = 4
"""What is seen: colour (3) as sRGB − ½, and Δd; added to the first channels of the state."""

CORNERS = 8
"""Cells around a point, z fastest."""


class Weights(NamedTuple):
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
    def shapes(cls, channels: int, units: int) -> "Weights":
        """The shape of each."""
        square, bias = (units, units), (units,)
        return cls(
            (units, channels), bias, square, bias, square, bias, (OUTPUTS, units), (OUTPUTS,)
        )
