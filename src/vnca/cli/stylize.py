"""`vnca stylize MODEL SEQUENCE --out DIR`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import parse
from vnca.cli.terminal import Terminal, finishing
from vnca.io.smoke import SmokeFormat
from vnca.painting.config import StylizeConfig
from vnca.recipe import painting
from vnca.recipe.recorded import recorded_smoke
from vnca.rule.model import Model


@dataclass(frozen=True, kw_only=True)
class Stylize(painting.StylizeRun):
    """Paint a smoke sequence with a trained rule."""

    model: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MODEL")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEQUENCE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: StylizeConfig = field(default_factory=StylizeConfig)
    """How the rule is applied."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and paint; smoke is read as for training unless options say otherwise.

    SIGTERM ends it once a frame is finished.
    """
    options = parse("stylize", Stylize, arguments)
    model = Model.load(options.model)
    smoke = recorded_smoke(options.model, model)
    if smoke is not None:
        missing: Any = tyro.MISSING
        defaults = Stylize(model=missing, sequence=missing, out=missing, smoke=smoke)
        options = parse("stylize", Stylize, arguments, default=defaults)
    with finishing() as stop_if_asked:
        for _ in painting.run(options, Terminal(stop_if_asked), model):
            pass
