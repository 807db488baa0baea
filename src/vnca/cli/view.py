"""`vnca view [MODEL] [SEQUENCE]`: a page on which rules paint while one looks."""

import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import tyro

from vnca.cli.options import parse
from vnca.cli.terminal import Terminal, say
from vnca.io import SmokeFormat
from vnca.recipe import viewing


@dataclass(frozen=True, kw_only=True)
class View(viewing.ViewRun):
    """Watch rules paint smoke, live in a browser with WebGPU."""

    model: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="MODEL")] = None
    """A model file, the folder of a run, or a style of the library; the others can be chosen on the
    page."""
    sequence: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="SEQUENCE")] = None
    """A folder, a pattern or a file; of a model in the folder of its run the frame of the training
    unless given, else a plume that is simulated."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and show the page; Ctrl-C ends it."""
    options = parse("view", View, arguments)

    def opened(address: str) -> None:
        say(f"the page is at {address} until Ctrl-C")
        if options.browser:
            webbrowser.open(address)

    viewing.run(options, Terminal(), opened)
