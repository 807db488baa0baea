"""`vnca bench {step,train,stylize}`: what vnca costs on the machine at hand."""

from collections.abc import Sequence

from vnca.cli.subcommands import run_subcommand

COMMANDS = {
    "step": "time one step of the automaton in every backend",
    "train": "time iterations of training",
    "stylize": "time frames of painting a sequence",
}


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands."""
    run_subcommand("bench", "Measure what vnca costs on this machine.", COMMANDS, arguments)
