"""`vnca bench {step,train,stylize}`: what vnca costs on the machine at hand."""

import importlib
from collections.abc import Sequence

from vnca.errors import OptionError

COMMANDS = {
    "step": "time one step of the automaton in every backend",
    "train": "time iterations of training",
    "stylize": "time frames of painting a sequence",
}


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands, each a module of this package named after it.

    Raises:
        OptionError: If there is none of that name.
    """
    name, rest = (arguments[0], arguments[1:]) if arguments else ("", ())
    if name in ("-h", "--help"):
        print(_usage())
        return
    if name not in COMMANDS:
        raise OptionError(f"bench: expected one of {', '.join(COMMANDS)}, got '{name}'")
    importlib.import_module(f"vnca.cli.bench_{name}").run(rest)


def _usage() -> str:
    lines = [f"  {name:10} {what}" for name, what in COMMANDS.items()]
    return "\n".join(
        [
            "usage: vnca bench COMMAND [OPTIONS]",
            "",
            "Measure what vnca costs on this machine.",
            "",
            "commands:",
            *lines,
            "",
            "`vnca bench COMMAND --help` lists the options of a command.",
        ]
    )
