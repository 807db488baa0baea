"""What is given by name, and read if it is what it should be.

Dataclasses with some of their fields given by keywords of Python or by a file; and entries of JSON
documents, which may hold anything anywhere, most of which numpy takes without a word: a text times
a whole number is that text many times over, `true` is one, and −1 is the last of a list.
"""

import ast
import dataclasses
import inspect
import math
import textwrap
from collections.abc import Mapping
from contextlib import suppress
from difflib import get_close_matches
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import OptionError

T = TypeVar("T")
_WANTED: dict[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
    Path: "a path",
    NoneType: "none",
}


def with_values(default: T, given: Mapping[str, Any], outer: str = "") -> T:
    """A dataclass with some of its fields replaced, each by a value of the type of the field.

    A field that is a dataclass itself takes an instance, or a mapping of its own fields. Whole
    numbers are taken for numbers, lists for tuples, and a mapping for texts NAME=VALUE.

    Args:
        default: An instance.
        given: New values by the name of the field.
        outer: What stands before their names in errors, such as `view.`.

    Raises:
        OptionError: If there is no field of a name, or a value is of another type or refused.
    """
    kind = type(default)
    hints = get_type_hints(kind)
    require_known(given, hints.keys(), outer)
    changed = {}
    for name, value in given.items():
        before = getattr(default, name)
        if dataclasses.is_dataclass(before) and isinstance(value, Mapping):
            changed[name] = with_values(before, value, f"{outer}{name}.")
            continue
        try:
            changed[name] = _fitted(hints[name], value)
        except TypeError:
            raise OptionError(
                f"`{outer}{name}` {value!r}: expected {_wanted(hints[name])}"
            ) from None
    return dataclasses.replace(default, **changed)  # type: ignore[type-var]


def fields_of(instance: Any) -> dict[str, Any]:
    """The fields of a dataclass by their names, as they are."""
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(instance)}


def changed_fields(instance: Any, default: Any) -> list[str]:
    """The names of the fields in which two instances of a dataclass differ."""
    return [
        field.name
        for field in dataclasses.fields(instance)
        if getattr(instance, field.name) != getattr(default, field.name)
    ]


def require_known(given: Mapping[str, Any], known: Any, outer: str = "") -> None:
    """Refuse names that are not among those that are known.

    Raises:
        OptionError: If there is one, with what may have been meant.
    """
    for name in given:
        if name not in known:
            near = get_close_matches(name, sorted(known), n=3)
            hint = (
                f"did you mean {' or '.join(f'`{outer}{one}`' for one in near)}?"
                if near
                else f"expected one of {', '.join(sorted(known))}"
            )
            raise OptionError(f"`{outer}{name}`: no such option; {hint}")


def _fitted(hint: Any, value: Any) -> Any:
    """A value as a field of a type holds it.

    Raises:
        TypeError: If it is of another type.
    """
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        for one in inside:
            with suppress(TypeError):
                return _fitted(one, value)
        raise TypeError
    if origin is Literal:
        fits = any(type(value) is type(one) and value == one for one in inside)
    elif origin is tuple:
        if isinstance(value, Mapping) and inside == (str, Ellipsis):
            value = [f"{name}={each}" for name, each in value.items()]
        fits = isinstance(value, (list, tuple))
        if fits:
            is_any_length = inside[-1] is Ellipsis
            if not is_any_length and len(value) != len(inside):
                raise TypeError
            hints = [inside[0]] * len(value) if is_any_length else inside
            value = tuple(_fitted(one, item) for one, item in zip(hints, value, strict=True))
    elif hint is int:
        fits = isinstance(value, Integral) and not isinstance(value, bool)
        value = int(value) if fits else value
    elif hint is float:
        fits = isinstance(value, Real) and not isinstance(value, bool)
        value = float(value) if fits else value
    elif hint is Path:
        fits = isinstance(value, (str, Path))
        value = Path(value) if fits else value
    else:
        fits = isinstance(value, hint)
    if not fits:
        raise TypeError
    return value


def _wanted(hint: Any) -> str:
    """What a field of a type takes, in words."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(_wanted(one) for one in inside if one is not NoneType)
    if origin is Literal:
        choices = [*map(str, inside)]
        return " or ".join(choices) if len(choices) < 3 else f"one of {', '.join(choices)}"
    if origin is tuple:
        return f"a list, each {_wanted(inside[0])}"
    if dataclasses.is_dataclass(hint):
        return "its own fields by name"
    return _WANTED.get(hint) or str(hint.__name__)


def field_texts(kind: type) -> dict[str, str]:
    """The string under each field of a dataclass, and of those that it is made of, by name."""
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        if not dataclasses.is_dataclass(one):
            continue
        try:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
        except (OSError, TypeError):  # installed without its source
            continue
        assert isinstance(tree, ast.ClassDef)
        for field, text in zip(tree.body, tree.body[1:], strict=False):
            if (
                isinstance(field, ast.AnnAssign)
                and isinstance(field.target, ast.Name)
                and isinstance(text, ast.Expr)
                and isinstance(text.value, ast.Constant)
            ):
                found[field.target.id] = str(text.value.value)
    return found


def distributed(given: Mapping[str, Any], *defaults: Any) -> tuple[Any, ...]:
    """Dataclasses with some of their fields replaced, each keyword in the one that has it.

    A field that is a dataclass itself takes an instance or a mapping of its own fields.

    Args:
        given: New values by the name of the field.
        defaults: Instances that share no field.

    Raises:
        OptionError: If no dataclass has a field of a name, or one refuses a value.
    """
    names = [{field.name for field in dataclasses.fields(one)} for one in defaults]
    require_known(given, set().union(*names))
    return tuple(
        with_values(one, {name: value for name, value in given.items() if name in own})
        for one, own in zip(defaults, names, strict=True)
    )


def changed(name: str, default: T, given: T | Mapping[str, Any] | None) -> T:
    """The dataclass `given`, or `default` with those of its fields that a mapping gives.

    Raises:
        OptionError: If it has no field of a name, or refuses a value.
    """
    if given is None:
        return default
    return with_values(default, given, f"{name}.") if isinstance(given, Mapping) else given


def numbers(entry: dict[str, Any], name: str, default: tuple[float, ...]) -> AnyArray:
    """As many finite numbers as the default has, which stands for a missing list; float64.

    Raises:
        ValueError: If there is something else.
    """
    values = entry.get(name, default)
    if not (
        isinstance(values, (list, tuple))
        and len(values) == len(default)
        and all(map(_is_number, values))
    ):
        raise ValueError(f"its `{name}` should be {len(default)} finite numbers")
    return np.array(values, np.float64)


def number(entry: dict[str, Any], name: str, default: float) -> float:
    """A finite number; the default where there is none.

    Raises:
        ValueError: If there is something else.
    """
    value = entry.get(name, default)
    if not _is_number(value):
        raise ValueError(f"its `{name}` should be a finite number")
    return float(value)


def whole(entry: dict[str, Any], name: str, default: int | None = None) -> int:
    """A whole number from zero on; the default where there is none.

    Raises:
        ValueError: If there is something else, or nothing and no default.
    """
    value = entry.get(name, default)
    # JSON knows one kind of numbers: some writers put 3.0.
    if not _is_number(value) or value != int(value) or value < 0:
        raise ValueError(f"its `{name}` should be a whole number from 0 on")
    return int(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
