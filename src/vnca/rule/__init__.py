"""The update rule of an automaton: its hyperparameters, weights, normalisers and decoder.

γ, the paper's brightness control, is such a normaliser: chosen here, from the training frame.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import OptionError, ShapeError
from vnca.core.lattice import Region
from vnca.engine.automaton import FILTERS, Automaton, DecoderWeights, Weights, stencil
from vnca.engine.domain import DomainKind
from vnca.rule.conditioning import STYLES, columns, conditioning_named

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

    It knows no place, in its cell or anywhere, so nothing that it draws is tied to the grid.

    Attributes:
        weights: float32 arrays, as `Weights` has them.
    """

    weights: DecoderWeights

    def __post_init__(self) -> None:
        first = self.weights.first
        units, channels = first.shape if first.ndim == 2 else (0, 0)
        named = zip(
            DecoderWeights._fields,
            self.weights,
            DecoderWeights.shapes(channels, units),
            strict=True,
        )
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
        bounds = DecoderWeights(
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
        shapes = DecoderWeights.shapes(channels, units)
        drawn = (random.uniform(-b, b, s) for b, s in zip(bounds, shapes, strict=True))
        weights = DecoderWeights(*(array.astype(np.float32) for array in drawn))
        weights.output[COLOURS:] = 0  # the density is left as it is until it is trained
        return cls(weights)

    @staticmethod
    def rates(frequency: float = FREQUENCY) -> DecoderWeights:
        """What the learning rate is multiplied by for each of the weights, floats.

        Reference: `engine/DECODE.md`, "There is no ω here".
        """
        sine, linear = (frequency, frequency), (1.0, 1.0)
        return DecoderWeights(*sine, *sine, *sine, *linear)

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


CONDITIONING = ("position", "density", "velocity")
"""What a rule is conditioned on unless asked otherwise: the paper's priors."""
PRIORS = 7
"""Numbers these are: position 3, density 1, velocity 3; one that is switched off is zero."""

COLOUR = slice(0, 3)
"""Channels that are shown, as sRGB minus one half."""
DENSITY_CHANGE = 3
"""Channel of Δd, used clamped to ±`DENSITY_LIMIT`."""
DENSITY_LIMIT = 0.5

SMOKE_THRESHOLD = 0.01
"""Normalised density from which a cell counts as smoke; fainter smoke is not painted."""


@dataclass(frozen=True)
class RuleConfig:
    """The shape of a rule."""

    channels: int = 12
    """Channels of a cell's state: colour (3), density change (1), the rest hidden."""
    hidden: int = 96
    """Width of the hidden layer."""
    update_probability: float = 0.5
    """Chance of a cell to change in a step."""
    steps_per_frame: int = 16
    """Steps of the automaton between two frames; the rule is taught to move at this pace."""
    domain: DomainKind = "active"
    """Which cells are active: those near the smoke, or all of its box as in the paper."""
    transport: bool = False
    """Whether the velocity carries the state along between frames. A rule that was taught so keeps
    patterns as they are; otherwise it is the rule that has to move them, as in the paper."""
    dilation: int = 1
    """Cells are active up to this far from the smoke; beyond is the outside that border cells
    see."""
    sobel_divisor: float = 32.0
    """Divisor of the 3×3×3 Sobel filters."""
    laplacian_divisor: float = 26.0
    """Divisor of the 27-point Laplacian."""
    position_prior: bool = True
    """Condition cells on where in the box of the training they are."""
    density_prior: bool = True
    """Condition cells on the density of the smoke."""
    velocity_prior: bool = True
    """Condition cells on the velocity of the smoke."""
    conditioning: tuple[str, ...] = CONDITIONING
    """What the hidden layer sees beside the perception, by name and in this order: position,
    density, velocity, and what else was registered."""

    def __post_init__(self) -> None:
        for name in self.conditioning:
            conditioning_named(name)
        if len(set(self.conditioning)) < len(self.conditioning):
            raise OptionError(
                f"`conditioning` {', '.join(self.conditioning)}: expected each of them once"
            )
        count = self.style_count
        if count == 1 or (count and self.conditioning[-count:] != STYLES[:count]):
            raise OptionError(
                f"`conditioning` {', '.join(self.conditioning)}: expected the shares of two styles "
                "or more last, from style_1 on"
            )
        if self.channels < 4:
            raise OptionError(f"`channels` {self.channels}: at least 4 are needed (colour and Δd)")
        if self.hidden < 1:
            raise OptionError(f"`hidden` {self.hidden}: at least 1 is needed")
        if not 0 < self.update_probability <= 1:
            raise OptionError(f"`update_probability` {self.update_probability}: must be in (0, 1]")
        if not 1 <= self.steps_per_frame <= 4096:
            raise OptionError(f"`steps_per_frame` {self.steps_per_frame}: must be from 1 to 4096")
        if not 0 <= self.dilation <= 64:
            raise OptionError(f"`dilation` {self.dilation}: must be from 0 to 64 cells")
        if not all(0 < d < math.inf for d in (self.sobel_divisor, self.laplacian_divisor)):
            raise OptionError("`sobel_divisor` and `laplacian_divisor` must be positive")

    @property
    def inputs(self) -> int:
        """Inputs of the hidden layer: perception and conditioning."""
        return FILTERS * self.channels + self.conditioning_width

    @property
    def conditioning_width(self) -> int:
        """Numbers P that a cell is conditioned on, those that are switched off among them."""
        return sum(conditioning_named(name).width for name in self.conditioning)

    @property
    def style_count(self) -> int:
        """How many styles it mixes; 0 of a rule of a single style, which is not told it."""
        return sum(name in STYLES for name in self.conditioning)

    @property
    def style_columns(self) -> slice | None:
        """Where in the conditioning `[n, P]` the shares of styles are; None of a single style."""
        count, width = self.style_count, self.conditioning_width
        return slice(width - count, width) if count else None

    def columns(self, name: str) -> slice | None:
        """Where in the conditioning `[n, P]` an input is; None if it is not there or always 0."""
        return columns(self.conditioning)[name] if self.is_conditioned_on(name) else None

    def is_conditioned_on(self, name: str) -> bool:
        """Whether an input is listed, and not switched off."""
        return name in self.conditioning and getattr(self, f"{name}_prior", True)


@dataclass(frozen=True)
class Scales:
    """What turns the numbers of files into the numbers a rule sees and the renderer draws."""

    density: float = 1.0
    """Density of a file that counts as 1."""
    velocity: float = 1.0
    """Cells per frame that count as 1."""
    gamma: float = 1.0
    """Extinction of density 1, per cell: the paper's brightness control."""

    def __post_init__(self) -> None:
        for name in ("density", "velocity", "gamma"):
            if not 0 < getattr(self, name) < math.inf:
                raise OptionError(f"scale '{name}' {getattr(self, name)}: must be positive")

    def extinction(self, cell_length: float) -> float:
        """Of density 1 in a file, per length of its world, where cells are so long."""
        return self.gamma / (self.density * cell_length)


def density_scale(density: FloatArray) -> float:
    """The density that counts as 1: the 99th percentile of what is not empty."""
    smoke = density[density > 0]
    return float(np.percentile(smoke, 99)) if len(smoke) else 1.0


@dataclass(frozen=True, eq=False)
class Rule:
    """A rule that can be applied: s' = s + m · W2 relu(W1 [perception ‖ priors] + b1).

    Attributes:
        hidden: W1 `[hidden, 5C + P]`.
        bias: b1 `[hidden]`.
        output: W2 `[C, hidden]`.
        config: Its shape.
        scales: Its normalisers.
        place: Where it was trained, in which cells have a position. Without it, that is the box of
            the domain.
        decoder: What lets its states be seen between cells; without one they are interpolated.
    """

    hidden: FloatArray
    bias: FloatArray
    output: FloatArray
    config: RuleConfig = field(default_factory=RuleConfig)
    scales: Scales = field(default_factory=Scales)
    place: Region | None = None
    decoder: Decoder | None = None

    def __post_init__(self) -> None:
        expected = {
            "hidden": (self.config.hidden, self.config.inputs),
            "bias": (self.config.hidden,),
            "output": (self.config.channels, self.config.hidden),
        }
        for name, shape in expected.items():
            weights = getattr(self, name)
            if weights.shape != shape:
                raise ShapeError(f"weights '{name}': expected shape {shape}, got {weights.shape}")
            if not np.isfinite(weights).all():
                raise ShapeError(f"weights '{name}': not all finite")
        if self.decoder is not None and self.decoder.channels != self.config.channels:
            raise ShapeError(
                f"decoder weights 'first': expected {self.config.channels} channels as the rule "
                f"has, got {self.decoder.channels}"
            )

    @classmethod
    def initial(
        cls, config: RuleConfig, scales: Scales, *, seed: int, xavier_gain: float = 0.0
    ) -> "Rule":
        """A rule before training: b1 and W2 zero, so that nothing changes yet.

        Args:
            config: Its shape.
            scales: Its normalisers.
            seed: Of the random numbers.
            xavier_gain: W1 is normal with this gain (Glorot and Bengio 2010); uniform (He) at 0.
        """
        bound = np.sqrt(6 / config.inputs)
        random = np.random.default_rng(seed)
        shape = (config.hidden, config.inputs)
        if xavier_gain:
            hidden = random.normal(0, xavier_gain * np.sqrt(2 / sum(shape)), shape)
        else:
            hidden = random.uniform(-bound, bound, shape)
        return cls(
            hidden=hidden.astype(np.float32),
            bias=np.zeros(config.hidden, dtype=np.float32),
            output=np.zeros((config.channels, config.hidden), dtype=np.float32),
            config=config,
            scales=scales,
        )

    def automaton(self, seed: int) -> Automaton:
        """What a session steps; `seed` is that of the update mask."""
        filters = stencil(
            sobel_divisor=self.config.sobel_divisor,
            laplacian_divisor=self.config.laplacian_divisor,
        )
        weights = Weights(self.hidden, self.bias, self.output)
        return Automaton(weights, filters, self.config.update_probability, seed)

    def rescaled(self, *, density: float | None = None, gamma: float | None = None) -> "Rule":
        """The rule with another density that counts as 1, or γ; what is None stays."""
        scales = replace(
            self.scales, density=density or self.scales.density, gamma=gamma or self.scales.gamma
        )
        return replace(self, scales=scales)

    def refined(self, factor: int) -> "Rule":
        """The rule for cells `factor` times as fine, where it does in a step what it did before.

        Smoke crosses `factor` times as many cells in a frame, which get `factor` times as many
        steps; a cell, so much thinner, absorbs so much less.
        """
        config, scales = self.config, self.scales
        return replace(
            self,
            config=replace(config, steps_per_frame=factor * config.steps_per_frame),
            scales=replace(scales, velocity=factor * scales.velocity, gamma=scales.gamma / factor),
        )

    @property
    def weight_count(self) -> int:
        """Number of trained weights, those of the decoder included."""
        own = self.hidden.size + self.bias.size + self.output.size
        return own + (self.decoder.weight_count if self.decoder else 0)


def gamma_for_cell_opacity(density: AnyArray, opacity: float) -> float:
    """Extinction γ of density 1, 1/cell, at which one cell of typical smoke has an opacity.

    Typical is the density met by a random particle of smoke: the mean of d weighted by d. 1 where
    there is no smoke.

    Near 1 a view shows the surface of the smoke, and a texture as fine as its cells; a low
    opacity mixes the colours of many cells along each ray.

    Args:
        density: Any shape, non-negative.
        opacity: In (0, 1).
    """
    typical = _typical(density)
    return float(-np.log1p(-opacity) / typical) if typical else 1.0


def gamma_for_own_colour(density: AnyArray) -> float:
    """Extinction γ of density 1, 1/cell, at which the paper's integrand shows smoke as it is.

    There emission does not grow with γ: the weights of a ray through cells of one density d that
    let nothing through add up to d / (exp(γ d) − 1). They are 1 at this γ, where d is the density
    of typical smoke: it is as bright as its colour. At a γ that makes a cell opaque by emission and
    absorption it is nearly black. 1 where there is no smoke.

    Args:
        density: Any shape, non-negative.
    """
    typical = _typical(density)
    return float(np.log1p(typical) / typical) if typical else 1.0


def _typical(density: AnyArray) -> float:
    """The density met by a random particle of smoke; 0 where there is none."""
    total = density.sum(dtype=np.float64)
    return float(np.square(density, dtype=np.float64).sum() / total) if total > 0 else 0.0
