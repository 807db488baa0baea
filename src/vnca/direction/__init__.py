"""What a user asks of a painting, from place to place and from frame to frame.

Numbers are told by themselves or by text (`grammar.py`); whoever paints asks a `Direction` for them
at places of a `Moment`.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import GridError, OptionError
from vnca.core.field import Field
from vnca.direction.carried import Carried
from vnca.direction.colour import Editing, require_exchange
from vnca.direction.colour.fire import emission
from vnca.direction.colour.grading import graded
from vnca.direction.grammar import parsed, parsed_guide
from vnca.direction.guides import inwards, steering, unit
from vnca.direction.mixing import Answer, mixed, per_colour
from vnca.direction.moment import Inputs, Missing, Moment
from vnca.direction.shares import completed, is_even
from vnca.direction.silhouette import Silhouette, fluffed, outlined
from vnca.direction.values import Constant, Keys, Value

__all__ = ["Carried", "Direction", "Inputs", "Limits", "Moment"]

_ROUNDING = 1e-5


class Limits(NamedTuple):
    """Between which numbers a directed number may lie."""

    low: float
    high: float


Amount = float | str
"""A number, or the text of a value."""
Share = Annotated[Amount, Limits(0, 1)]
MIXES = ("style_mix", "blend")
"""Options that say of how much something is mixed."""


@dataclass(frozen=True)
class Direction:
    """What is asked of a painting; text in the place of a number says where, when, how much."""

    strength: Share = 1.0
    """Colour of the painting, from 0 (white smoke) to 1; or a mask, keys over frames, … as all
    VALUEs (docs/guide/direct.md)."""
    density_strength: Share = 1.0
    """How much the painting changes the density, from 0 (not at all) to 1."""
    steps_per_frame: Annotated[Amount | None, Limits(0, 10_000)] = None
    """Steps of the automaton between two frames; as many as in training unless given. On a grid K
    times as fine they are K times as many, given or not."""
    pattern_speed: Annotated[Amount | None, Limits(-8, 8)] = None
    """How fast the velocity carries the pattern: 0 not at all, 1 along with the smoke, 2 ahead of
    it; 1 unless given, but 0 for a rule that was taught to move its pattern by itself."""
    pattern_size: Annotated[Amount, Limits(0.5, 2)] = 1.0
    """How many times as large the pattern is as in training, from 0.5 to 2."""
    guide: str | None = None
    """Along what strokes run: x, y, z or an axis as 0,1,1; velocity, curl or gradient of the smoke;
    @NAME, a grid of vectors; curve("FILE"); cross(GUIDE, GUIDE); keys of these over frames."""
    hue: Annotated[Amount, Limits(-360, 360)] = 0.0
    """Degrees by which the colours of the painting turn, from red towards yellow."""
    saturation: Annotated[Amount, Limits(0, 10)] = 1.0
    """How colourful it is, compared with the painting: 0 is grey."""
    lightness: Annotated[Amount, Limits(-1, 1)] = 0.0
    """What is added to how light its colours look, from -1 to 1."""
    exposure: Annotated[Amount, Limits(-20, 20)] = 0.0
    """Stops by which its colours are brighter; each doubles them."""
    grading: Share = 1.0
    """How much of `recolour` and `match` is seen, from 0 to 1."""
    edge: Annotated[Amount, Limits(-8, 3)] = 0.0
    """Cells by which the outline of the smoke is moved, as the painting draws it: below zero
    inwards, above outwards."""
    fire: Annotated[Amount, Limits(0, 100_000)] = 0.0
    """Temperature in Kelvin, such as @temperature:0..1->300..2200: the light that it gives is
    written beside the colour, as the grid emission."""
    fire_strength: Annotated[Amount, Limits(0, 1000)] = 1.0
    """What that light is multiplied by."""
    recolour: tuple[str, ...] = ()
    """Exchanges of the picture's main colours, OLD=NEW, as #1b2a49=#7a1f1f; or by their number in
    `vnca info`, as 2=#7a1f1f."""
    match: Path | None = None
    """A picture whose palette the painting is to have."""
    silhouette: Silhouette = "free"
    """Whether the painting may change the density at the edge of the smoke: free, soft (half as
    much as inside), keep (not at all)."""
    keep_mass: bool = False
    """Keep as much smoke in all as there was."""
    masks: tuple[str, ...] = ()
    """Masks, NAME=VALUE; others call them @NAME."""
    style_mix: tuple[str, ...] = ()
    """Of a model that has learnt several styles, how much is painted of each: STYLE=VALUE by its
    name or number, or STYLE alone for all of it. The first takes what the others leave."""
    layers: tuple[str, ...] = ()
    """Styles or models over the first, STYLE=VALUE."""
    blend: tuple[str, ...] = ()
    """Models, MODEL=VALUE, whose weights are mixed with those of the first, frame by frame; all
    have to come from the same texture."""
    missing: Missing = "stop"
    """Where a frame lacks a grid that a value asks for: stop, zero, or hold the one before."""

    def __post_init__(self) -> None:
        for name, text in _entries("masks", self.masks):
            if not name.isidentifier():
                raise OptionError(f"`masks` {text!r}: {name!r} is no name; use letters, digits, _")
        for exchange in self.recolour:
            require_exchange(exchange)
        _ = self.guided  # refused here if it cannot be read
        for name in NUMBERS:
            self._require_limits(name, self.values[name], getattr(self, name))
        for (name, text), value in zip(_entries("layers", self.layers), self.shares, strict=True):
            self._require_limits(f"layers.{name}", value, text, Limits(0, 1))
        for option in MIXES:
            entries = _entries(option, getattr(self, option), whole="1")
            for (name, text), value in zip(entries, self.mixes[option], strict=True):
                self._require_limits(f"{option}.{name}", value, text, Limits(0, 1))
        for name, value in zip(self.mixed_names("blend"), self.mixes["blend"], strict=True):
            if not is_even(value):
                raise OptionError(
                    f"`blend.{name}`: a rule has the same weights everywhere; they may change from "
                    "frame to frame alone (over places: `layers`)"
                )

    @cached_property
    def masked(self) -> Mapping[str, Value]:
        """Values by the names of masks; one may be made of those before it."""
        known: dict[str, Value] = {}
        for name, text in _entries("masks", self.masks):
            known[name] = parsed(text, f"masks.{name}", known)
        return known

    @cached_property
    def values(self) -> Mapping[str, Value | None]:
        """The value of each number, by its name; None for one that is not given."""
        return {name: self._value(name, getattr(self, name)) for name in NUMBERS}

    @cached_property
    def guided(self) -> Value | None:
        """The guide; None without one."""
        return None if self.guide is None else parsed_guide(self.guide, "guide")

    @property
    def steers(self) -> bool:
        """Whether the pattern may be turned or another size anywhere."""
        return self.guided is not None or self.values["pattern_size"] != Constant(1.0)

    def steering(self, moment: Moment, cells: AnyArray, standing: bool) -> FloatArray | None:
        """By what cells `[n, 3]` are steered, see `guides.steering`; None if they are not.

        Raises:
            GridError: If the size is out of its limits, or a grid is not there.
        """
        if not self.steers:
            return None
        size = self.value("pattern_size", moment, cells)
        if self.guided is None:
            return steering(None, None, size, len(cells))
        directions = unit(np.asarray(self.guided.at(moment, cells)))
        return steering(directions, inwards(moment, cells), size, len(cells), standing)

    @property
    def substeps(self) -> int:
        """In how many shorter steps a step is to be done.

        A pattern k times as large spreads k² times as fast in cells: steps as long as they were
        taught would be unstable.
        """
        size = self.values["pattern_size"]
        most = 1.0 if size is None else min(size.most, NUMBERS["pattern_size"].high)
        return math.ceil(max(1.0, most) ** 2 - _ROUNDING)

    @cached_property
    def shares(self) -> tuple[Value, ...]:
        """How much is seen of each layer."""
        given = _entries("layers", self.layers)
        return tuple(parsed(text, f"layers.{name}", self.masked) for name, text in given)

    @cached_property
    def mixes(self) -> Mapping[str, tuple[Value, ...]]:
        """How much is asked for of each style, and of each model whose weights are mixed."""
        return {
            option: tuple(
                parsed(text, f"{option}.{name}", self.masked)
                for name, text in _entries(option, getattr(self, option), whole="1")
            )
            for option in MIXES
        }

    def mixed_names(self, option: str) -> tuple[str, ...]:
        """Of which style or model each of them is, by an option in `MIXES`."""
        return tuple(name for name, _ in _entries(option, getattr(self, option), whole="1"))

    @property
    def layer_names(self) -> tuple[str, ...]:
        """The style or model of each layer."""
        return tuple(name for name, _ in _entries("layers", self.layers))

    def parts(self) -> Iterator[Value]:
        """All values that are asked for, and what they are made of."""
        mixes = (value for option in MIXES for value in self.mixes[option])
        for value in (*self.values.values(), self.guided, *self.shares, *mixes):
            if value is not None:
                yield from value.parts()

    def require(self, inputs: Inputs) -> None:
        """Look at all that values ask for, before the first frame.

        Raises:
            VncaError: If a file cannot be read, or frames lack a grid.
        """
        for value in dict.fromkeys(self.parts()):
            look = getattr(value, "require", None)
            if look is not None:
                look(inputs)

    def files(self, inputs: Inputs) -> list[Path]:
        """Which files values read beside the smoke, in a fixed order."""
        found = [] if self.match is None else [self.match]
        for value in self.parts():
            files = getattr(value, "files", None)
            found += [] if files is None else files(inputs)
        return list(dict.fromkeys(found))

    def value(self, name: str, moment: Moment, places: AnyArray) -> Answer:
        """A number at places `[n, 3]` of a frame, in index coordinates of its smoke.

        Raises:
            GridError: If it is out of its limits, or a grid is not there.
        """
        value = self.values[name]
        assert value is not None, "what may be left out is asked for only where it is given"
        return _within(value.at(moment, places), NUMBERS[name], name, getattr(self, name), moment)

    def share(self, layer: int, moment: Moment, places: AnyArray) -> Answer:
        """How much is seen of a layer, as `value` tells a number."""
        answer = self.shares[layer].at(moment, places)
        return _within(answer, Limits(0, 1), "layers", self.layers[layer], moment)

    def mix(
        self, option: str, which: Sequence[int], count: int, moment: Moment, places: AnyArray
    ) -> FloatArray:
        """Shares of styles, or of models, together 1: `[count]`, or of each place `[n, count]`.

        Args:
            option: One of `MIXES`.
            which: Of which of them each value is, the first 0.
            count: Of all of them.
            moment: The frame.
            places: `[n, 3]`.
        """
        given = zip(self.mixes[option], getattr(self, option), strict=True)
        answers = [
            _within(value.at(moment, places), Limits(0, 1), option, text, moment)
            for value, text in given
        ]
        return completed(answers, which, count)

    def coloured(
        self, colour: FloatArray, moment: Moment, places: AnyArray, editing: Editing
    ) -> FloatArray:
        """Colours `[n, 3]` of the painting at places, changed as asked."""
        if editing.changes:
            share = self.value("grading", moment, places)
            colour = np.asarray(mixed(colour, editing.of(colour), per_colour(share)))
        asked = {
            name: self.value(name, moment, places)
            for name in ("hue", "saturation", "lightness", "exposure")
        }
        return graded(colour, **asked)

    def outlined(self, factors: FloatArray, moment: Moment, places: AnyArray) -> FloatArray:
        """Factors `[n]` of the density at places, as outline and edge let them be."""
        edge = self.value("edge", moment, places)
        if self.silhouette == "free" and np.all(np.equal(edge, 0)):
            return factors
        return outlined(factors, moment.sampled(moment.depth, places), self.silhouette, edge)

    @cached_property
    def asks_for_places(self) -> bool:
        """Whether anything may be another from place to place."""
        even = all(isinstance(part, (Constant, Keys)) for part in self.parts())
        outline = self.silhouette != "free" or self.values["edge"] != Constant(0.0)
        return not even or outline

    @property
    def fluff(self) -> int:
        """How many cells beyond the smoke there may be some, at most."""
        edge = self.values["edge"]
        return 0 if edge is None else math.ceil(2 * max(0.0, min(edge.most, NUMBERS["edge"].high)))

    def fluffed(
        self,
        density: Field,
        colour: Field,
        factors: Field,
        moment: Moment,
        places: Callable[[AnyArray], AnyArray],
    ) -> tuple[Field, Field]:
        """Density and colour with the outline moved outwards where asked; see `silhouette.py`."""
        if not self.fluff:
            return density, colour
        return fluffed(
            density, colour, factors, places, moment, partial(self.value, "edge", moment)
        )

    @property
    def burns(self) -> bool:
        """Whether anything gives light."""
        return self.values["fire"] != Constant(0.0)

    def emission(self, moment: Moment, places: AnyArray) -> FloatArray:
        """The light `[n, 3]` that places give, linear RGB."""
        kelvin, strength = (self.value(n, moment, places) for n in ("fire", "fire_strength"))
        return emission(np.broadcast_to(np.float32(kelvin), len(places)), strength)

    def _value(self, name: str, given: Any) -> Value | None:
        if isinstance(given, str):
            return parsed(given, name, self.masked)
        return None if given is None else Constant(float(given))

    def _require_limits(
        self, name: str, value: Value | None, given: Any, limits: Limits | None = None
    ) -> None:
        """Refuse numbers that can be told to be out of their limits."""
        low, high = limits or NUMBERS[name]
        for number in [] if value is None else value.numbers():
            if not low <= number <= high:  # not-a-number is neither
                shown = f"{given}: {number:g}" if isinstance(given, str) else f"{number:g}"
                raise OptionError(f"`{name}` {shown}: must be from {low:g} to {high:g}")


def _entries(option: str, texts: tuple[str, ...], whole: str = "") -> list[tuple[str, str]]:
    """Names and values of texts NAME=VALUE.

    Args:
        option: What messages call it.
        texts: The texts.
        whole: The value of a name alone; without it a value is needed.

    Raises:
        OptionError: If one has no name or no value.
    """
    found = []
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign and whole:
            sign, value = "=", whole
        if not (sign and name.strip() and value.strip()):
            raise OptionError(f"`{option}` {text!r}: expected a name, an equals sign and a value")
        found.append((name.strip(), value.strip()))
    return found


def _within(answer: Answer, limits: Limits, name: str, given: Any, moment: Moment) -> Answer:
    if np.size(answer) == 0:
        return answer
    lowest, highest = float(np.min(answer)), float(np.max(answer))
    slack = _ROUNDING * (limits.high - limits.low)
    if not (limits.low - slack <= lowest and highest <= limits.high + slack):
        raise GridError(
            f"frame {moment.frame}: `{name}` {given}: goes from {lowest:g} to {highest:g}, "
            f"expected {limits.low:g} to {limits.high:g}; give it a range, as in @mask:0..3"
        )
    if isinstance(answer, float):
        return min(max(answer, limits.low), limits.high)
    return np.clip(answer, limits.low, limits.high)


def _numbers() -> Mapping[str, Limits]:
    """The fields of a direction that are numbers, and their limits."""
    hints = get_type_hints(Direction, include_extras=True)
    marked = {
        name: get_args(hint)[1:] for name, hint in hints.items() if get_origin(hint) is Annotated
    }
    return {name: marks[0] for name, marks in marked.items()}


NUMBERS = _numbers()
"""The numbers of a direction, and their limits."""
