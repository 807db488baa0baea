"""Options of a command as JSON, and back: to ask later for what was asked for before."""

import dataclasses
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from vnca.core.errors import ModelError
from vnca.io.smoke_format import SmokeFormat
from vnca.rule.model import Model, from_record

PICTURE_CELLS = "picture_cells"
"""What says in a model how many cells wide the rule was shown its picture, the shorter side."""

T = TypeVar("T")


def recorded(options: Any) -> dict[str, Any]:
    """The fields of a dataclass, and of those inside it, as JSON values."""
    return dataclasses.asdict(options, dict_factory=_json)


def _json(fields: list[tuple[str, Any]]) -> dict[str, Any]:
    return {name: str(value) if isinstance(value, Path) else value for name, value in fields}


def restored(kind: type[T], values: Mapping[str, Any]) -> T:
    """An instance of the dataclass `kind` of what was recorded of one.

    Raises:
        TypeError: If a field is missing, unknown, or of another type.
        OptionError: If the dataclass refuses a value.
    """
    hints = get_type_hints(kind)
    if not isinstance(values, Mapping) or hints.keys() != values.keys():
        raise TypeError(f"expected the options {', '.join(hints)}, got {', '.join(values)}")
    return kind(**{name: _restored(hint, values[name], name) for name, hint in hints.items()})


def _restored(hint: Any, value: Any, name: str) -> Any:
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        for one in inside:
            with suppress(TypeError):
                return _restored(one, value, name)
    elif origin is Literal:
        if value in inside:
            return value
    elif origin is tuple:
        if isinstance(value, list):
            return tuple(_restored(inside[0], item, name) for item in value)
    elif dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return restored(hint, value)
    elif hint is Path and isinstance(value, str):
        return Path(value)
    elif type(value) is hint or (hint is float and type(value) is int and abs(value) < 2**53):
        return value
    raise TypeError(f"{name}: {value!r} is not of its type")


def recorded_smoke(path: Path, model: Model) -> SmokeFormat | None:
    """How smoke was read for the training of a model, if its file, at `path`, tells.

    Raises:
        ModelError: If what it tells makes no sense.
    """
    smoke = model.training.get("smoke")
    if not smoke:
        return None
    try:
        return from_record(SmokeFormat, smoke)
    except TypeError as error:
        raise ModelError(f"{path}: damaged model metadata (smoke: {error})") from error
