"""From dataclasses to options: the one place that knows how a command line is read."""

import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import tyro

from vnca.cli.progress import as_options, end_line

T = TypeVar("T")


def parse(command: str, options: Callable[..., T], arguments: Sequence[str], **keywords: Any) -> T:
    """An instance of the dataclass `options` from command line arguments.

    Help and the messages for unknown or malformed options come from tyro, which exits with
    code 2 for the latter.
    """
    return tyro.cli(options, prog=f"vnca {command}", args=list(arguments), **keywords)


def chosen(arguments: Sequence[str], option: str, default: str) -> str:
    """The value of an option that has to be known before the others can be read."""
    value = default
    for word, following in zip(arguments, [*arguments[1:], default], strict=True):
        if word == option:
            value = following
        elif word.startswith(f"{option}="):
            value = word.partition("=")[2]
    return value


def is_given(arguments: Sequence[str], option: str) -> bool:
    """Whether an option that decides how the others are read is among the arguments."""
    return any(word.partition("=")[0] == option for word in arguments)


def say(line: str) -> None:
    """Tell the user something that is not the result: on standard error, on a line of its own."""
    end_line()
    print(as_options(line), file=sys.stderr, flush=True)
