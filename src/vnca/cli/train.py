"""`vnca train FRAME STYLE … --out RUN`, `vnca texture train STYLE … --out RUN`, and going on."""

import webbrowser
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import chosen, is_given, parse
from vnca.cli.terminal import Terminal, say
from vnca.core.errors import OptionError
from vnca.io import SmokeFormat
from vnca.recipe import smoke, texture, viewing
from vnca.training.config import SmokeConfig, TextureConfig
from vnca.training.presets import DEFAULT, as_toml, preset, preset_names

SHOW_PRESET = "--show-preset"
_MISSING: Any = tyro.MISSING


@dataclass(frozen=True, kw_only=True)
class Train(smoke.SmokeRun):
    """Learn a rule from one frame of smoke and one picture, or several.

    `vnca train --resume RUN` goes on with a training that was interrupted.
    `vnca train --show-preset > mine.toml` writes a preset to change, and to train with by `-p
    mine.toml`.
    """

    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    frame: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FRAME")]
    """A frame of smoke: OpenVDB, or npz as Mantaflow writes it."""
    more_frames: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="[FRAME …]")] = ()
    """Further frames, of its sequence or of other smoke, that the rule is trained on by turns with
    it: so it paints smoke that it never saw as it paints these."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture (docs/guide/formats.md lists the formats)."""
    more_styles: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="[STYLE …]")
    ] = ()
    """Further pictures, up to eight in all."""
    preset: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = DEFAULT
    """Values of all hyperparameters that are not given: draft, standard, paper, authors, or a TOML
    file."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: SmokeConfig = field(default_factory=SmokeConfig)
    """Hyperparameters."""
    view: bool = False
    """Watch the rule as it learns, with its loss curves, in a browser with WebGPU."""


@dataclass(frozen=True, kw_only=True)
class Resume(smoke.ResumeSmokeRun):
    """Go on with a training that was interrupted, as if it had not been."""


@dataclass(frozen=True, kw_only=True)
class ShowPreset:
    """Print a preset, with what is given in its place, as a TOML file to copy and change."""

    show_preset: bool = True
    """What is asked for."""
    preset: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = DEFAULT
    """The preset."""
    config: SmokeConfig = field(default_factory=SmokeConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class TrainTexture(texture.TextureRun):
    """Learn a solid texture from one picture, or several.

    `vnca texture train --resume RUN` goes on with a training that was interrupted.
    `vnca texture train --show-preset > mine.toml` writes a preset to change, and to train with by
    `-p mine.toml`.
    """

    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture (docs/guide/formats.md lists the formats)."""
    more_styles: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="[STYLE …]")
    ] = ()
    """Further pictures, up to eight in all."""
    preset: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = DEFAULT
    """Values of all hyperparameters that are not given: draft, standard, or a TOML file."""
    config: TextureConfig = field(default_factory=TextureConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class ResumeTexture(texture.ResumeTextureRun):
    """Go on with a training that was interrupted, as if it had not been."""


@dataclass(frozen=True, kw_only=True)
class ShowTexturePreset(ShowPreset):
    """Print a preset, with what is given in its place, as a TOML file to copy and change."""

    config: TextureConfig = field(default_factory=TextureConfig)  # type: ignore[assignment]
    """Hyperparameters."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and train on smoke, or go on with a training."""
    if is_given(arguments, "--resume"):
        smoke.resume_run(parse(smoke.COMMAND, Resume, arguments), Terminal())
        return
    if is_given(arguments, "--init") and is_given(arguments, "--texture"):
        raise OptionError(smoke.TEXTURE_OR_INIT)
    name = chosen(arguments, "--preset", DEFAULT)
    config = preset(SmokeConfig, name)
    if is_given(arguments, SHOW_PRESET):
        _show(smoke.COMMAND, arguments, ShowPreset(preset=name, config=config))
        return
    defaults = Train(frame=_MISSING, style=_MISSING, out=_MISSING, config=config)
    options = parse(smoke.COMMAND, Train, arguments, default=defaults)
    with training_watched(options) if options.view else nullcontext():
        smoke.run(options, Terminal())


def training_watched(options: Train) -> AbstractContextManager[None]:
    """A page on which the training can be watched while the context lasts."""

    def opened(address: str) -> None:
        say(f"the training can be watched at {address}")
        webbrowser.open(address)

    return viewing.training_watched(options.out, options.frame, options.smoke, Terminal(), opened)


def run_texture(arguments: Sequence[str]) -> None:
    """Read the options and train a solid texture, or go on with a training."""
    if is_given(arguments, "--resume"):
        texture.resume_run(parse(texture.COMMAND, ResumeTexture, arguments), Terminal())
        return
    name = chosen(arguments, "--preset", DEFAULT)
    config = preset(TextureConfig, name)
    if is_given(arguments, SHOW_PRESET):
        _show(texture.COMMAND, arguments, ShowTexturePreset(preset=name, config=config))
        return
    defaults = TrainTexture(style=_MISSING, out=_MISSING, config=config)
    texture.run(parse(texture.COMMAND, TrainTexture, arguments, default=defaults), Terminal())


def _show(command: str, arguments: Sequence[str], defaults: ShowPreset) -> None:
    shown = parse(command, type(defaults), arguments, default=defaults)
    base = shown.preset if shown.preset in preset_names(type(shown.config)) else DEFAULT
    print(as_toml(shown.config, base), end="")
