"""Commands that are chosen by name: running one, and telling what there are."""

import importlib
from collections.abc import Mapping, Sequence

from vnca.cli.help import ASKED
from vnca.core.errors import OptionError

Commands = Mapping[str, str]
"""What each does, by name."""


def run_subcommand(
    command: str, purpose: str, commands: Commands, arguments: Sequence[str]
) -> None:
    """Run a command of a command: the module of this package that is named after both.

    Args:
        command: As it is called without `vnca`.
        purpose: What it is there for, a sentence.
        commands: Those to choose from.
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
    importlib.import_module(f"vnca.cli.{command}_{name}").run(rest)


def usage(call: str, purpose: str, commands: Commands) -> str:
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
