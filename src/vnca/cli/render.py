"""`vnca render SEQUENCE --out FILM`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import tyro

from vnca.cli.options import parse
from vnca.cli.terminal import Terminal
from vnca.recipe import rendering


@dataclass(frozen=True, kw_only=True)
class Render(rendering.RenderRun):
    """Make a film or a turntable of a sequence, painted or not, or a picture of each frame."""

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEQUENCE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and render."""
    rendering.run(parse("render", Render, arguments), Terminal())
