"""Presets: configurations of a training as TOML files, of the package or of a user."""

import dataclasses
import json
import sys
import textwrap
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file
from vnca.core.records import field_texts, with_values
from vnca.training.config import SmokeConfig, TextureConfig, TrainingConfig

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

DEFAULT = "draft"
SUFFIX = ".toml"
BASE = "base"
"""Key of the preset of the package that gives what a file leaves out."""
CHOSEN = "none"
"""In the place of a number that is chosen when training begins; TOML has no word for it."""
FOLDERS: dict[type[TrainingConfig], str] = {SmokeConfig: "smoke", TextureConfig: "texture"}
"""Where the package has its presets, by what they configure."""
_SHIPPED = files("vnca.data") / "presets"
_WIDTH = 98

C = TypeVar("C", bound=TrainingConfig)


def preset_names(kind: type[TrainingConfig]) -> list[str]:
    """The presets of the package for a kind of training, the default first."""
    names = [
        Path(file.name).stem
        for file in (_SHIPPED / FOLDERS[kind]).iterdir()
        if file.name.endswith(SUFFIX)
    ]
    return sorted(names, key=lambda name: (name != DEFAULT, name))


def preset(kind: type[C], name: str | Path) -> C:
    """The configuration that a preset describes.

    Args:
        kind: `SmokeConfig` or `TextureConfig`.
        name: A preset of the package, or a TOML file. A file has a key for each field of the
            configuration, and a table for each field that has fields of its own, or names under
            `base` a preset of the package that gives what it leaves out.

    Raises:
        OptionError: If there is no such preset.
        FileFormatError: If the file cannot be read, or a key is unknown, missing or of a value
            that cannot be.
    """
    names = preset_names(kind)
    if str(name) in names:
        text = (_SHIPPED / FOLDERS[kind] / f"{name}{SUFFIX}").read_text(encoding="utf-8")
        return _read(kind, text, f"preset {name}")
    path = Path(name)
    if path.suffix != SUFFIX:
        raise OptionError(
            f"`preset` {name}: expected one of {', '.join(names)}, or a {SUFFIX} file"
        )
    try:
        text = existing_file(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path}: cannot be read as text ({error})") from error
    return _read(kind, text, str(path))


def _read(kind: type[C], text: str, where: str) -> C:
    try:
        given = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise FileFormatError(f"{where}: not TOML ({error})") from error
    if BASE in given:
        base, names = given.pop(BASE), preset_names(kind)
        if base not in names:
            raise FileFormatError(f"{where}: {BASE} = {base!r}: expected one of {', '.join(names)}")
        default = preset(kind, base)
    else:
        default = kind()
        if missing := [*_missing(default, given)]:
            others = f" and {len(missing) - 1} others are" if len(missing) > 1 else " is"
            raise FileFormatError(
                f"{where}: {missing[0]}{others} missing; "
                f'add {BASE} = "{DEFAULT}" to take what is left out from there'
            )
    try:
        return with_values(default, _without_none(default, given))
    except OptionError as error:
        # It speaks of keys, not of arguments of a call.
        raise FileFormatError(f"{where}: {str(error).replace('`', '')}") from error


def _missing(default: Any, given: Mapping[str, Any], outer: str = "") -> Iterator[str]:
    """What a file leaves out; where None is the default, leaving it out means that."""
    for field in dataclasses.fields(default):
        value = getattr(default, field.name)
        if dataclasses.is_dataclass(value):
            inside = given.get(field.name, {})
            if isinstance(inside, Mapping):
                yield from _missing(value, inside, f"{outer}{field.name}.")
        elif field.name not in given and value is not None:
            yield f"{outer}{field.name}"


def _without_none(default: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """What is given, with None for `CHOSEN` where a field can be None."""
    plain: dict[str, Any] = {}
    for name, value in given.items():
        before = getattr(default, name, None)
        if dataclasses.is_dataclass(before) and isinstance(value, Mapping):
            plain[name] = _without_none(before, value)
        else:
            is_optional = getattr(type(default), name, default) is None
            plain[name] = None if is_optional and value == CHOSEN else value
    return plain


def as_toml(config: TrainingConfig, base: str) -> str:
    """A preset file of a configuration: every field, with what it means.

    Args:
        config: The configuration.
        base: The preset of the package that a later version takes its new fields from.
    """
    head = f"{BASE} = {json.dumps(base)}  # gives what is left out below"
    return "\n".join([head, *_lines(config)]) + "\n"


def _lines(config: Any, outer: str = "") -> Iterator[str]:
    texts = field_texts(type(config))
    fields = [(field.name, getattr(config, field.name)) for field in dataclasses.fields(config)]
    for name, value in fields:
        if not dataclasses.is_dataclass(value):
            text = " ".join(texts.get(name, "").split())
            yield ""
            yield from textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ")
            yield f"{name} = {_written(value)}"
    for name, value in fields:
        if dataclasses.is_dataclass(value):
            yield from ["", f"[{outer}{name}]"]
            yield from _lines(value, f"{outer}{name}.")


def _written(value: Any) -> str:
    if value is None:
        return json.dumps(CHOSEN)
    if isinstance(value, tuple):
        return f"[{', '.join(map(_written, value))}]"
    # Strings of JSON are strings of TOML; numbers and truth values look alike in both.
    return json.dumps(value, ensure_ascii=False) if isinstance(value, (str, bool)) else repr(value)
