"""`vnca paint SMOKE PICTURE --out DIR`: the whole job."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import parse
from vnca.cli.terminal import Terminal, finishing
from vnca.io.smoke import SmokeFormat
from vnca.recipe import paint


@dataclass(frozen=True, kw_only=True)
class Paint(paint.PaintRun):
    """Paint a smoke sequence in the style of a picture: train, stylize and film in one go.

    What more there is to set, `vnca train`, `vnca stylize` and `vnca render` take one by one.
    """

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SMOKE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PICTURE")]
    """The picture to learn from (docs/guide/formats.md lists the formats); or a model that has
    learned already, a file or the folder of a run."""
    preset: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = "draft"
    """How the rule is trained: draft, standard, paper, or a TOML file."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and do the whole job; SIGTERM ends it once a piece of it is finished."""
    options = parse(paint.COMMAND, Paint, arguments)
    smoke = paint.recorded_format(options)
    if smoke != options.smoke:
        missing: Any = tyro.MISSING
        defaults = Paint(sequence=missing, style=Path(), out=missing, smoke=smoke)
        defaults = dataclasses.replace(defaults, style=missing)
        options = parse(paint.COMMAND, Paint, arguments, default=defaults)
    with finishing() as stop_if_asked:
        for _ in paint.run(options, Terminal(stop_if_asked)):
            pass
