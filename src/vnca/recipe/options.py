"""From the keywords of a Python call to the dataclasses that they are fields of."""

import dataclasses
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, TypeVar

from vnca.core.errors import OptionError

T = TypeVar("T")


def distributed(given: Mapping[str, Any], *defaults: Any) -> tuple[Any, ...]:
    """Dataclasses with some of their fields replaced, each keyword in the one that has it.

    A field that is a dataclass itself takes an instance or a mapping of its own fields.

    Args:
        given: New values by the name of the field.
        defaults: Instances that share no field.

    Raises:
        OptionError: If no dataclass has a field of a name, or one refuses a value.
    """
    known = {field.name for one in defaults for field in dataclasses.fields(one)}
    _require_known(given, known)
    return tuple(_replaced(one, given) for one in defaults)


def _replaced(default: T, given: Mapping[str, Any], outer: str = "") -> T:
    changed = {}
    for field in dataclasses.fields(default):  # type: ignore[arg-type]
        if field.name not in given:
            continue
        value, before = given[field.name], getattr(default, field.name)
        if dataclasses.is_dataclass(before) and isinstance(value, Mapping):
            name = f"{outer}{field.name}."
            _require_known(value, {inner.name for inner in dataclasses.fields(before)}, name)
            value = _replaced(before, value, name)
        elif isinstance(before, tuple) and isinstance(value, list):
            value = tuple(value)
        changed[field.name] = value
    try:
        return dataclasses.replace(default, **changed)  # type: ignore[type-var]
    except TypeError as error:  # a value that cannot be compared with a number, say
        raise OptionError(
            f"{', '.join(f'`{outer}{n}` {changed[n]!r}' for n in changed)}: {error}"
        ) from error


def _require_known(given: Mapping[str, Any], known: set[str], outer: str = "") -> None:
    for name in given:
        if name not in known:
            near = get_close_matches(name, sorted(known), n=3)
            hint = (
                f"did you mean {' or '.join(f'`{outer}{one}`' for one in near)}?"
                if near
                else (f"expected one of {', '.join(sorted(known))}")
            )
            raise OptionError(f"`{outer}{name}`: no such option; {hint}")


def named(name: str, choices: Mapping[str, T], option: str) -> T:
    """The choice of a name.

    Raises:
        OptionError: If there is none of it.
    """
    if name not in choices:
        raise OptionError(f"`{option}` {name!r}: expected one of {', '.join(choices)}")
    return choices[name]


def changed(name: str, default: T, given: T | Mapping[str, Any] | None) -> T:
    """The dataclass `given`, or `default` with those of its fields that a mapping gives.

    Raises:
        OptionError: If it has no field of a name, or refuses a value.
    """
    if given is None:
        return default
    if not isinstance(given, Mapping):
        return given
    _require_known(given, {field.name for field in dataclasses.fields(default)}, f"{name}.")  # type: ignore[arg-type]
    return _replaced(default, given, f"{name}.")
