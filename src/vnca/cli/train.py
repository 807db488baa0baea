"""`vnca train FRAME STYLE --out RUN`, and `vnca train --resume RUN`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import chosen, is_given, parse
from vnca.cli.watch import Terminal
from vnca.io.smoke import SmokeFormat
from vnca.recipe import smoke
from vnca.training.smoke_config import PRESETS, SmokeConfig


@dataclass(frozen=True, kw_only=True)
class Train(smoke.SmokeRun):
    """Learn a rule from one frame of smoke and one picture.

    `vnca train --resume RUN` goes on with a training that was interrupted.
    """

    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    frame: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FRAME")]
    """A frame of smoke: OpenVDB, or npz as Mantaflow writes it."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[SmokeConfig, tyro.conf.arg(name="")] = field(default_factory=SmokeConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class Resume(smoke.ResumeSmokeRun):
    """Go on with a training that was interrupted, as if it had not been."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and train, or go on with a training."""
    if is_given(arguments, "--resume"):
        smoke.resume_run(parse(smoke.COMMAND, Resume, arguments), Terminal())
        return
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    defaults = Train(
        frame=missing, style=missing, out=missing, config=PRESETS.get(preset, SmokeConfig())
    )
    smoke.run(parse(smoke.COMMAND, Train, arguments, default=defaults), Terminal())
