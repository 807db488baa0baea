"""From text to values: one small language for every number of a direction.

docs/guide/direct.md is its manual. What cannot be read is told with the character where it begins.
"""

import re
from collections.abc import Mapping
from dataclasses import MISSING, fields
from itertools import pairwise
from typing import Any, NamedTuple, NoReturn, get_args, get_type_hints

from vnca.core.errors import OptionError, TextError
from vnca.direction.carried import Advected, Age
from vnca.direction.guides import NATURAL, Across, Axis, Natural
from vnca.direction.guides.curve import Curve
from vnca.direction.guides.grid import VectorGrid
from vnca.direction.masks.grids import FileGrid, Grid
from vnca.direction.masks.mesh import Solid
from vnca.direction.masks.picture import Picture
from vnca.direction.masks.shapes import Ball, Cuboid
from vnca.direction.values import (
    SOURCES,
    Constant,
    Keys,
    Operation,
    Ramp,
    Shape,
    Source,
    Value,
)

CALLS: Mapping[str, type[Value]] = {
    "box": Cuboid,
    "sphere": Ball,
    "mesh": Solid,
    "picture": Picture,
    "grid": FileGrid,
    "advected": Advected,
}
"""What is called by name; its fields are what it is given, in their order."""
GUIDES: Mapping[str, type[Value]] = {"curve": Curve, "cross": Across}
"""The same where directions are expected."""
_AXES = {"x": Axis(1, 0, 0), "y": Axis(0, 1, 0), "z": Axis(0, 0, 1)}
_JOINED = ("min", "max")
_SHAPES: tuple[str, ...] = get_args(Shape)
_NUMBER = r"(?:\d+(?:\.(?!\.)\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_TOKEN = re.compile(
    rf"""(?P<space>\s+)
    |(?P<key>(?:(?<=[\s(,=])|^)-?\d+(?:\.\d+)?:)
    |(?P<number>{_NUMBER})
    |(?P<grid>@(?:\w+(?:\.\w+)*|"[^"]*"|'[^']*'))
    |(?P<name>[A-Za-z_]\w*)
    |(?P<text>"[^"]*"|'[^']*')
    |(?P<sign>\.\.|->|[-+*(),=:])""",
    re.VERBOSE,
)
_DEEPEST = 50


class _Token(NamedTuple):
    kind: str
    text: str
    at: int


def parsed(text: str, name: str, masks: Mapping[str, Value] | None = None) -> Value:
    """The value that a text stands for.

    Args:
        text: The text.
        name: What messages call it.
        masks: Values that `@` names, before grids of the smoke.

    Raises:
        TextError: If it cannot be read.
    """
    return _Reader(text, name, masks or {}).whole()


def parsed_guide(text: str, name: str) -> Value:
    """The guide that a text stands for.

    Args:
        text: The text.
        name: What messages call it.

    Raises:
        TextError: If it cannot be read.
    """
    return _Reader(text, name, {}, of_directions=True).whole()


def rebased(text: str, folder: Any) -> str:
    """The same with the paths of files in it that are relative, as of a folder."""
    parts, end = [], 0
    tokens = _tokens(text, "")
    for before, token in pairwise(tokens):
        if token.kind == "text" and before.text == "(":
            parts += [text[end : token.at], f'"{folder / token.text[1:-1]}"']
            end = token.at + len(token.text)
    return "".join([*parts, text[end:]])


def _tokens(text: str, name: str) -> list[_Token]:
    tokens, at = [], 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            raise TextError(
                f"`{name}` {text!r}: {text[at]!r} at character {at + 1} means nothing here",
                text,
                at,
            )
        if found.lastgroup != "space":
            tokens.append(_Token(str(found.lastgroup), found[0], at))
        at = found.end()
    return [*tokens, _Token("end", "", len(text))]


class _Reader:
    def __init__(
        self, text: str, name: str, masks: Mapping[str, Value], *, of_directions: bool = False
    ) -> None:
        self._text, self._name, self._masks = text, name, masks
        self._one = self._direction if of_directions else self._sum
        self._tokens = _tokens(text, name)
        self._next = self._depth = 0

    @property
    def _token(self) -> _Token:
        return self._tokens[self._next]

    def _taken(self) -> _Token:
        token = self._token
        self._next += token.kind != "end"
        return token

    def _skipped(self, *signs: str) -> str:
        """The sign that comes next, taken, if it is one of some."""
        return self._taken().text if self._token.text in signs else ""

    def _expected(self, what: str) -> NoReturn:
        token = self._token
        got = "the end" if token.kind == "end" else repr(token.text)
        self._refused(f"expected {what}, got {got}", token.at)

    def _refused(self, why: str, at: int) -> NoReturn:
        raise TextError(
            f"`{self._name}` {self._text!r}: at character {at + 1}: {why}", self._text, at
        )

    def whole(self) -> Value:
        value = self._value()
        if self._token.kind != "end":
            self._expected("its end" if self._token.kind != "key" else "keys from the beginning on")
        return value

    def _value(self) -> Value:
        self._depth += 1
        if self._depth > _DEEPEST:
            self._refused("too many values inside each other", self._token.at)
        shape: Any = "linear"
        if self._token.text in _SHAPES and self._tokens[self._next + 1].kind == "key":
            shape = self._taken().text
        value = self._keys(shape) if self._token.kind == "key" else self._one()
        self._depth -= 1
        return value

    def _keys(self, shape: Shape) -> Value:
        frames: list[float] = []
        values: list[Value] = []
        while self._token.kind == "key":
            token = self._taken()
            frame = float(token.text[:-1])
            if frames and frame <= frames[-1]:
                self._refused(
                    f"frame {frame:g} after frame {frames[-1]:g}; keys have to be in order",
                    token.at,
                )
            frames.append(frame)
            values.append(self._one())
        return Keys(tuple(frames), tuple(values), shape)

    def _direction(self) -> Value:
        token = self._token
        if self._skipped("("):
            value = self._value()
            self._closed(token)
            return value
        if token.kind == "grid":
            return VectorGrid(self._taken().text[1:].strip("\"'"))
        if token.kind == "number" or token.text == "-":
            return self._axis(token)
        if token.kind != "name":
            self._expected("a direction")
        name = self._taken().text
        if name in GUIDES:
            return self._called(token, GUIDES[name])
        if name in NATURAL:
            return Natural(name)
        if name not in _AXES:
            known = ", ".join([*_AXES, *NATURAL, *(f"{each}(…)" for each in GUIDES)])
            self._refused(
                f"{name!r} is no direction; expected {known}, three numbers, or @ and a grid of "
                "vectors",
                token.at,
            )
        return _AXES[name]

    def _axis(self, token: _Token) -> Value:
        numbers = [self._number()]
        for _ in range(2):
            if not self._skipped(","):
                self._expected("three numbers with commas, as in 0,1,1")
            numbers.append(self._number())
        if not any(numbers):
            self._refused("expected a direction; of three zeros there is none", token.at)
        return Axis(*numbers)

    def _sum(self) -> Value:
        value = self._product()
        while symbol := self._skipped("+", "-"):
            value = Operation(symbol, value, self._product())
        return value

    def _product(self) -> Value:
        value = self._ramp()
        while self._skipped("*"):
            value = Operation("*", value, self._ramp())
        return value

    def _ramp(self) -> Value:
        if self._skipped("-"):
            value = self._ramp()
            if isinstance(value, Constant):
                return Constant(-value.number)
            return Operation("-", Constant(0.0), value)
        shape: Any = self._taken().text if self._token.text in _SHAPES else ""
        value = self._atom()
        if not self._skipped(":"):
            if shape:
                self._expected(f"keys or a range after {shape}, such as :0..1")
            return value
        low, high, at = *self._range(), self._token.at
        if low == high:
            self._refused("expected a range from one number to another", at - 1)
        start, end = self._range() if self._skipped("->") else (0.0, 1.0)
        return Ramp(value, low, high, start, end, shape or "linear")

    def _range(self) -> tuple[float, float]:
        low = self._number()
        if not self._skipped(".."):
            self._expected("two dots, as in 0..1")
        return low, self._number()

    def _number(self) -> float:
        minus = self._skipped("-")
        if self._token.kind != "number":
            self._expected("a number")
        return float(minus + self._taken().text)

    def _atom(self) -> Value:
        token = self._token
        if self._skipped("("):
            value = self._value()
            self._closed(token)
            return value
        if token.kind == "number":
            return Constant(float(self._taken().text))
        if token.kind == "grid":
            name = self._taken().text[1:].strip("\"'")
            return self._masks.get(name) or Grid(name)
        if token.kind == "name":
            return self._named(self._taken())
        return self._expected("a value")

    def _named(self, token: _Token) -> Value:
        name = token.text
        if name in SOURCES:
            return Source(name)
        if name == "age":
            return Age()
        if name not in (*CALLS, *_JOINED):
            known = ", ".join([*SOURCES, "age", *(f"{each}(…)" for each in (*CALLS, *_JOINED))])
            self._refused(f"{name!r} is not known; expected {known}, or @ and a name", token.at)
        return self._called(token, CALLS.get(name))

    def _called(self, token: _Token, kind: type[Value] | None) -> Value:
        """What comes of a name and what it is given; values are joined where it is no kind."""
        opening = self._token
        if not self._skipped("("):
            self._expected(f"what {token.text} is given, in parentheses")
        given, named = self._arguments()
        self._closed(opening)
        if kind is None:
            return self._joined(token, given, named)
        return self._made(kind, token, given, named)

    def _closed(self, opening: _Token) -> None:
        if not self._skipped(")"):
            self._expected(f"')' for the '(' at character {opening.at + 1}")

    def _arguments(self) -> tuple[list[tuple[Any, int]], dict[str, tuple[Any, int]]]:
        """What is given by place and by name, each with the character where it begins."""
        given: list[tuple[Any, int]] = []
        named: dict[str, tuple[Any, int]] = {}
        while self._token.text != ")" and self._token.kind != "end":
            token, after = self._token, self._tokens[self._next + 1]
            if token.kind == "name" and after.text == "=":
                self._next += 2
                if token.text in named:
                    self._refused(f"{token.text!r} is given twice", token.at)
                named[token.text] = self._argument(), token.at
            elif named:
                self._expected("name=value, as before")
            else:
                given.append((self._argument(), token.at))
            if not self._skipped(","):
                break
        return given, named

    def _argument(self) -> Any:
        return self._taken().text[1:-1] if self._token.kind == "text" else self._value()

    def _joined(self, token: _Token, given: list[Any], named: Mapping[str, Any]) -> Value:
        values = [value for value, _ in given]
        if len(values) < 2 or named or not all(isinstance(value, Value) for value in values):
            self._refused(f"{token.text} is given two values or more", token.at)
        value, *others = values
        for other in others:
            value = Operation(token.text, value, other)
        return value

    def _made(
        self,
        kind: type[Value],
        token: _Token,
        given: list[tuple[Any, int]],
        named: dict[str, tuple[Any, int]],
    ) -> Value:
        wanted, hints = fields(kind), get_type_hints(kind)  # type: ignore[arg-type]
        names = [field.name for field in wanted]
        if len(given) > len(names):
            self._refused(f"{token.text} takes {', '.join(names)}, no more", given[len(names)][1])
        for name, place in zip(names, given, strict=False):
            if name in named:
                self._refused(f"{name!r} is given twice", named[name][1])
            named[name] = place
        for name, (value, at) in named.items():
            if name not in names:
                self._refused(f"{token.text} takes {', '.join(names)}, not {name!r}", at)
            is_text = isinstance(value, str)
            if is_text != (hints[name] is str):
                self._refused(
                    f"{name!r}: expected a {'value' if is_text else 'text in quotes'}", at
                )
        for field in wanted:
            if field.name not in named and field.default is MISSING:
                self._refused(
                    f"{token.text} lacks {field.name!r}; it takes {', '.join(names)}", token.at
                )
        try:
            return kind(**{name: value for name, (value, _) in named.items()})
        except OptionError as error:
            self._refused(str(error), token.at)
