"""From dataclasses to options: the one place that knows how a command line is read."""

import dataclasses
import importlib
import io
import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast, get_type_hints

import tyro
from tyro.constructors import (
    ConstructorRegistry,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from vnca.cli.help import ASKED, SHORT, default_of, help_text, option_name
from vnca.core.errors import OptionError

T = TypeVar("T")
STDOUT = Path("-")
"""Where `--json -` writes."""
_RULES = ConstructorRegistry()


@_RULES.struct_rule
def _dataclass(asked: StructTypeInfo) -> StructConstructorSpec | None:
    """Options of a dataclass, named as `option_name` has it: dataclasses know nothing of them."""
    if not dataclasses.is_dataclass(asked.type):
        return None
    hints = get_type_hints(asked.type, include_extras=True)
    fields = []
    for field in dataclasses.fields(asked.type):
        hint: Any = hints[field.name]
        if (name := option_name(asked.type, field.name)) is not None:
            hint = Annotated[hint, tyro.conf.arg(name=name)]
        default = default_of(field, asked.default)
        fields.append(StructFieldSpec(field.name, hint, default))
    return StructConstructorSpec(asked.type, tuple(fields))


def parse(
    command: str,
    options: Callable[..., T],
    arguments: Sequence[str],
    *,
    separator: str = " ",
    **keywords: Any,
) -> T:
    """An instance of the dataclass `options` from command line arguments.

    `--help` and `--help-all` are answered here.

    Args:
        command: As it is called, without `vnca`.
        options: The dataclass.
        arguments: Those of the command line, short forms `spelled_out`.
        separator: What stands between the values of an option that takes several, for the help.
        **keywords: For tyro, such as the instance that holds the defaults.

    Raises:
        OptionError: If an option is unknown, missing or malformed.
        SystemExit: If help was asked for; it is printed.
    """
    if set(ASKED).intersection(arguments):
        shown = help_text(
            command,
            cast("type", options),
            keywords.get("default"),
            all_of_them="--help-all" in arguments,
            separator=separator,
        )
        print(shown)
        raise SystemExit(0)
    complaint = io.StringIO()
    try:
        with redirect_stderr(complaint), _RULES:
            return tyro.cli(options, prog=f"vnca {command}", args=list(arguments), **keywords)
    except SystemExit:
        what = _in_one_line(complaint.getvalue())
        raise OptionError(f"{what} (vnca {command} --help-all lists all options)") from None


def _in_one_line(box: str) -> str:
    """What tyro says in a box of several lines, without the help of the options it speaks of."""
    said: list[str] = []
    is_wanted = True
    for line in box.splitlines():
        inside = line.strip("│╭╮╰╯").rstrip()
        if not inside.strip("─ ") or line[:1] in "╭╰":
            is_wanted = True
        elif re.match(r" *(Got errors|Argument helptext|For full helptext)", inside):
            is_wanted = False
        elif is_wanted and len(inside) - len(inside.lstrip()) <= _OPTION_INDENT:
            said.append(inside.strip())
    return " ".join(said).replace("{None}|", "").rstrip(".")


_OPTION_INDENT = 6


def spelled_out(arguments: Sequence[str]) -> list[str]:
    """Arguments with `--out` for `-o`, and so on, and keys of one value as one."""
    words: list[str] = []
    for argument in arguments:
        name, joint, value = argument.partition("=")
        word = SHORT.get(name, name) + joint + value
        if len(words) > 1 and _KEY.match(word) and _BEFORE_KEY.match(words[-1]):
            words[-1] += f" {word}"
        else:
            words.append(word)
    return words


_KEY = re.compile(r"-?\d+(\.\d+)?:[^:\\/]")
_BEFORE_KEY = re.compile(r"(linear|smooth|hold)$|((linear|smooth|hold) )?-?\d+(\.\d+)?:[^:\\/]")


def chosen(arguments: Sequence[str], option: str, default: str) -> str:
    """The value of an option that has to be known before the others can be read."""
    value = default
    for word, following in zip(arguments, [*arguments, default][1:], strict=True):
        if word == option:
            value = following
        elif word.startswith(f"{option}="):
            value = word.partition("=")[2]
    return value


def is_given(arguments: Sequence[str], option: str) -> bool:
    """Whether an option that decides how the others are read is among the arguments."""
    return any(word.partition("=")[0] == option for word in arguments)


def print_json(value: Any) -> None:
    """Print a result as JSON on standard output; numbers that JSON has no word for are null."""
    print(json.dumps(_plain(value), indent=2, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(name): _plain(inside) for name, inside in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inside) for inside in value]
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    return str(value)


def run_subcommand(
    command: str,
    purpose: str,
    commands: Mapping[str, str],
    homes: Mapping[str, str],
    arguments: Sequence[str],
) -> None:
    """Run a command of a command.

    Args:
        command: As it is called without `vnca`.
        purpose: What it is there for, a sentence.
        commands: What each of those to choose from does, by name.
        homes: The function of each, as `module:function` of this package.
        arguments: The name of one, and what it is to be given.

    Raises:
        OptionError: If there is none of that name.
    """
    name, rest = (arguments[0], arguments[1:]) if arguments else ("", ())
    if name in ASKED:
        print(usage(f"vnca {command}", purpose, commands))
        return
    if name not in commands:
        raise OptionError(f"vnca {command}: expected one of {', '.join(commands)}, got '{name}'")
    command_at(homes[name])(rest)


def command_at(home: str) -> Callable[[Sequence[str]], None]:
    """The function of a command, imported now: `module:function` of this package."""
    module, _, function = home.partition(":")
    return getattr(importlib.import_module(f"vnca.cli.{module}"), function)


def usage(call: str, purpose: str, commands: Mapping[str, str]) -> str:
    """What `call --help` prints."""
    width = max(map(len, commands))
    return "\n".join(
        [
            f"usage: {call} COMMAND [OPTIONS]",
            "",
            purpose,
            "",
            "commands:",
            *(f"  {name:{width}}  {what}" for name, what in commands.items()),
            "",
            f"`{call} COMMAND --help` lists the options of a command.",
        ]
    )
