"""What a rule lets be seen between its cells: the small network that comes with it."""

from dataclasses import dataclass

import numpy as np

from vnca.core.errors import ShapeError
from vnca.engine.decode_weights import Weights

UNITS = 32
"""Of each of its layers, unless it is told otherwise."""
FREQUENCY = 10.0
"""What a sine layer's weights are multiplied by before training; the rate at which those of the
sine layers learn is to be multiplied by it, too."""
COLOURS = 3
"""Of the outputs; what follows is Δd."""


@dataclass(frozen=True, eq=False)
class Decoder:
    """A network from the interpolated state alone to colour and Δd.

    It is told no place, in its cell or anywhere, so nothing that it draws is tied to the grid.

    Attributes:
        weights: float32 arrays, as `Weights` has them.
    """

    weights: Weights

    def __post_init__(self) -> None:
        first = self.weights.first
        units, channels = first.shape if first.ndim == 2 else (0, 0)
        named = zip(Weights._fields, self.weights, Weights.shapes(channels, units), strict=True)
        for name, array, shape in named:
            if array.shape != shape or min(shape) < 1:
                raise ShapeError(f"decoder weights '{name}': {array.shape} fits no network")
            if not np.isfinite(array).all():
                raise ShapeError(f"decoder weights '{name}': not all finite")

    @classmethod
    def initial(
        cls, channels: int, *, seed: int, units: int = UNITS, frequency: float = FREQUENCY
    ) -> "Decoder":
        """A decoder before training, which draws contours of the state.

        Args:
            channels: Of a cell's state.
            seed: Of the random numbers.
            units: Of each layer.
            frequency: How close the contours lie.

        Reference: Sitzmann et al. 2020, section 3.2; the first layer at two thirds of what is said
        there, as it was tried.
        """
        inputs, hidden = 1.5 * channels, np.sqrt(6 / units)
        bounds = Weights(
            first=frequency / inputs,
            first_bias=frequency / np.sqrt(inputs),
            second=hidden,
            second_bias=frequency / np.sqrt(units),
            third=hidden,
            third_bias=frequency / np.sqrt(units),
            output=hidden / frequency,
            output_bias=0,
        )
        random = np.random.default_rng(seed)
        shapes = Weights.shapes(channels, units)
        drawn = (random.uniform(-b, b, s) for b, s in zip(bounds, shapes, strict=True))
        weights = Weights(*(array.astype(np.float32) for array in drawn))
        weights.output[COLOURS:] = 0  # the density is left as it is until it is trained
        return cls(weights)

    @staticmethod
    def rates(frequency: float = FREQUENCY) -> Weights:
        """What the learning rate is multiplied by for each of the weights, floats.

        Reference: `engine/DECODE.md`, "There is no ω here".
        """
        sine, linear = (frequency, frequency), (1.0, 1.0)
        return Weights(*sine, *sine, *sine, *linear)

    @property
    def channels(self) -> int:
        """Of the states that it sees."""
        return self.weights.first.shape[1]

    @property
    def units(self) -> int:
        """Of each of its layers."""
        return self.weights.first.shape[0]

    @property
    def weight_count(self) -> int:
        """Number of trained weights."""
        return sum(array.size for array in self.weights)
