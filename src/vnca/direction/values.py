"""What text of a direction stands for: values that are asked for at places of a frame.

A value answers with a number where it is the same everywhere, and with `[n]` numbers, float32,
where it is not.
"""

from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.direction.mixing import Answer, eased, mixed

if TYPE_CHECKING:
    from vnca.direction.moment import Moment

Shape = Literal["linear", "smooth", "hold"]
"""How a value goes from one key to the next: straight, at rest at both, or by a leap."""


class Value:
    """A number that may be another from place to place and from frame to frame."""

    @abstractmethod
    def at(self, moment: "Moment", places: AnyArray) -> Answer:
        """The value in a frame.

        Args:
            moment: The frame.
            places: `[n, 3]` in index coordinates of its smoke, whole or between cells.

        Raises:
            GridError: If a grid that it takes is not there, or holds what is no number.
        """

    def parts(self) -> Iterator["Value"]:
        """It, and all the values that it is made of."""
        yield self
        for field in fields(self):  # type: ignore[arg-type]
            held = getattr(self, field.name)
            for one in held if isinstance(held, tuple) else (held,):
                if isinstance(one, Value):
                    yield from one.parts()

    def numbers(self) -> Iterator[float]:
        """Numbers that it is known to be somewhere, before any frame is."""
        return iter(())

    @property
    def most(self) -> float:
        """What it is at most anywhere; infinite where that is not known."""
        return np.inf


@dataclass(frozen=True)
class Constant(Value):
    """A number."""

    number: float

    def numbers(self) -> Iterator[float]:
        """See `Value.numbers`."""
        yield self.number

    @property
    def most(self) -> float:
        """See `Value.most`."""
        return self.number

    def at(self, moment: "Moment", places: AnyArray) -> Answer:
        """See `Value.at`."""
        return self.number


@dataclass(frozen=True)
class Keys(Value):
    """Values at frames; before the first and after the last it stays."""

    frames: tuple[float, ...]
    values: tuple[Value, ...]
    shape: Shape = "linear"

    def numbers(self) -> Iterator[float]:
        """See `Value.numbers`."""
        for value in self.values:
            yield from value.numbers()

    @property
    def most(self) -> float:
        """See `Value.most`."""
        return max(value.most for value in self.values)

    def at(self, moment: "Moment", places: AnyArray) -> Answer:
        """See `Value.at`."""
        after = bisect_right(self.frames, moment.frame)
        before = max(0, after - 1)
        after = min(after, len(self.frames) - 1)
        first = self.values[before].at(moment, places)
        if self.shape == "hold" or before == after:
            return first
        begin, end = self.frames[before], self.frames[after]
        part = (moment.frame - begin) / (end - begin)
        if part == 0:
            return first
        second = self.values[after].at(moment, places)
        return mixed(first, second, eased(part) if self.shape == "smooth" else part)


@dataclass(frozen=True)
class Ramp(Value):
    """A value between two others, as a part of the way, clamped to it; and that as a value."""

    of: Value
    low: float
    high: float
    start: float = 0.0
    end: float = 1.0
    shape: Shape = "linear"

    def numbers(self) -> Iterator[float]:
        """See `Value.numbers`."""
        yield from (self.start, self.end)

    @property
    def most(self) -> float:
        """See `Value.most`."""
        return max(self.start, self.end)

    def at(self, moment: "Moment", places: AnyArray) -> Answer:
        """See `Value.at`."""
        part = (self.of.at(moment, places) - self.low) / (self.high - self.low)
        if self.shape == "hold":
            part = np.floor(part)
        part = min(1.0, max(0.0, part)) if isinstance(part, float) else np.clip(part, 0, 1)
        part = eased(part) if self.shape == "smooth" else part
        return mixed(self.start, self.end, part)


def _of_both(pick: Callable[..., AnyArray], first: Answer, second: Answer) -> Answer:
    found = pick(first, second)
    return found if found.ndim else float(found)


OPERATIONS: Mapping[str, Callable[[Answer, Answer], Answer]] = {
    "+": partial(_of_both, np.add),
    "-": partial(_of_both, np.subtract),
    "*": partial(_of_both, np.multiply),
    "min": partial(_of_both, np.minimum),
    "max": partial(_of_both, np.maximum),
}


@dataclass(frozen=True)
class Operation(Value):
    """Two values joined by one of `OPERATIONS`."""

    symbol: str
    first: Value
    second: Value

    def at(self, moment: "Moment", places: AnyArray) -> Answer:
        """See `Value.at`."""
        joined = OPERATIONS[self.symbol]
        return joined(self.first.at(moment, places), self.second.at(moment, places))


@dataclass(frozen=True)
class Source(Value):
    """What is known of every place of a frame, by one of the names in `SOURCES`."""

    name: str

    def at(self, moment: "Moment", places: AnyArray) -> Answer:
        """See `Value.at`."""
        return SOURCES[self.name](moment, places)


def _height(moment: "Moment", places: AnyArray) -> FloatArray:
    lower, upper = moment.bounds
    part = (moment.world(places)[:, 2] - lower[2]) / (upper[2] - lower[2])
    return part.astype(np.float32)


def _along(axis: int) -> Callable[["Moment", AnyArray], FloatArray]:
    def coordinate(moment: "Moment", places: AnyArray) -> FloatArray:
        return moment.in_file(moment.world(places))[:, axis].astype(np.float32)

    return coordinate


SOURCES: Mapping[str, Callable[["Moment", AnyArray], Answer]] = {
    "density": lambda moment, places: moment.sampled(moment.smoke.density_field, places),
    "speed": lambda moment, places: moment.sampled(moment.speed, places),
    "height": _height,
    "x": _along(0),
    "y": _along(1),
    "z": _along(2),
    "distance": lambda moment, places: moment.sampled(moment.depth, places),
    "frame": lambda moment, places: float(moment.frame),
}
"""Density in the units of the file; speed in cells per frame of the smoke; height from 0, the
bottom of the smoke of all frames, to 1, their top; coordinates in the world of the file; how deep
in the smoke, in its cells; the number of the frame."""
