"""`vnca evaluate RUN [SEQUENCE]`, and `vnca evaluate FRAME STYLE --ablation velocity --out DIR`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import is_given, parse
from vnca.cli.watch import Terminal
from vnca.io.smoke import SmokeFormat
from vnca.painting.config import StylizeConfig
from vnca.recipe import evaluation
from vnca.recipe.recorded import load, recorded_smoke


@dataclass(frozen=True, kw_only=True)
class Evaluate(evaluation.EvaluateRun):
    """Measure how well a trained rule paints a sequence, and write a report with pictures.

    `vnca evaluate FRAME STYLE --ablation velocity --out DIR` trains with and without a part of
    the method instead, and compares how their textures move.
    """

    run: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="SEQUENCE")] = None
    """A folder, a pattern or a file; the frame of the training unless given."""
    out: Path | None = None
    """Folder for report.html and report.json; "evaluation" in that of the run unless given."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[StylizeConfig, tyro.conf.arg(name="")] = field(default_factory=StylizeConfig)
    """How the rule is applied."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure; smoke is read as it was for training unless told otherwise."""
    if is_given(arguments, "--ablation"):
        from vnca.cli import evaluate_ablation

        evaluate_ablation.run(arguments)
        return
    options = parse("evaluate", Evaluate, arguments)
    model = load(options.run)
    smoke = recorded_smoke(options.run, model)
    if smoke is not None:
        missing: Any = tyro.MISSING
        options = parse("evaluate", Evaluate, arguments, default=Evaluate(run=missing, smoke=smoke))
    out = options.out or evaluation.run_folder_of(options.run) / "evaluation"
    print(evaluation.run(dataclasses.replace(options, out=out), model, Terminal()))
