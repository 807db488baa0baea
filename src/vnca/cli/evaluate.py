"""`vnca evaluate RUN [SEQUENCE]`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import parse, print_json
from vnca.cli.terminal import Terminal
from vnca.io.smoke import SmokeFormat
from vnca.painting.config import StylizeConfig
from vnca.recipe import evaluation
from vnca.recipe.recorded import load, recorded_smoke


@dataclass(frozen=True, kw_only=True)
class Evaluate(evaluation.EvaluateRun):
    """Measure how well a trained rule paints a sequence, and write a report with pictures."""

    run: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="SEQUENCE")] = None
    """A folder, a pattern or a file; the frame of the training unless given."""
    out: Path | None = None
    """Folder for report.html and report.json; "evaluation" in that of the run unless given."""
    json: bool = False
    """Print the measures as JSON, as in report.json, instead of a table."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: StylizeConfig = field(default_factory=StylizeConfig)
    """How the rule is applied."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure; smoke is read as for training unless options say otherwise."""
    options = parse("evaluate", Evaluate, arguments)
    model = load(options.run)
    smoke = recorded_smoke(options.run, model)
    if smoke is not None:
        missing: Any = tyro.MISSING
        options = parse("evaluate", Evaluate, arguments, default=Evaluate(run=missing, smoke=smoke))
    out = options.out or evaluation.run_folder_of(options.run) / "evaluation"
    found = evaluation.run(dataclasses.replace(options, out=out), model, Terminal())
    if options.json:
        print_json(found.as_json())
    else:
        print(found)
