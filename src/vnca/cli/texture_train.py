"""`vnca texture train STYLE --out RUN`, and `vnca texture train --resume RUN`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import chosen, is_given, parse
from vnca.cli.watch import Terminal
from vnca.recipe import texture
from vnca.training.texture_config import PRESETS, TextureConfig


@dataclass(frozen=True, kw_only=True)
class TrainTexture(texture.TextureRun):
    """Learn a solid texture from one picture.

    `vnca texture train --resume RUN` goes on with a training that was interrupted.
    """

    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    config: Annotated[TextureConfig, tyro.conf.arg(name="")] = field(default_factory=TextureConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class ResumeTexture(texture.ResumeTextureRun):
    """Go on with a training that was interrupted, as if it had not been."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and train, or go on with a training."""
    if is_given(arguments, "--resume"):
        texture.resume_run(parse(texture.COMMAND, ResumeTexture, arguments), Terminal())
        return
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    config = PRESETS.get(preset, TextureConfig())
    defaults = TrainTexture(style=missing, out=missing, config=config)
    texture.run(parse(texture.COMMAND, TrainTexture, arguments, default=defaults), Terminal())
