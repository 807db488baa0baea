"""`vnca train FRAME STYLE --out RUN`, and `vnca train --resume RUN`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
import tyro

from vnca.cli import texture_train
from vnca.cli.options import chosen, is_given, parse, say
from vnca.cli.sequence import beside, read_alone
from vnca.cli.session import (
    ResumeOptions,
    Session,
    TrainingOptions,
    asked,
    choose_device,
    fitting,
    interrupted,
    run_folder,
    shown_and_judged,
)
from vnca.core.errors import GridError, OptionError
from vnca.core.files import remove_file
from vnca.core.typing import FloatArray
from vnca.core.volume import Volume
from vnca.features.load import load_network
from vnca.features.network import FeatureNetwork
from vnca.io.picture import read_style
from vnca.io.smoke import SmokeFormat, missing_velocity
from vnca.io.smoke_format import NO_VELOCITY
from vnca.rule.model import MODEL_NAME, Model
from vnca.rule.rule import Rule, RuleConfig
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint, fingerprints
from vnca.training.memory import memory_budget
from vnca.training.pretraining import SHAPE, SHARES, pretraining_config, without_prior_weights
from vnca.training.smoke_config import PRESETS, SmokeConfig
from vnca.training.smoke_trainer import smoke_trainer
from vnca.training.texture_config import TextureConfig

COMMAND = "train"
TEXTURE_FOLDER = "texture"
"""Folder, in that of a run, of the texture that it begins with."""


@dataclass(frozen=True)
class Train(TrainingOptions):
    """Learn a rule from one frame of smoke and one picture.

    `vnca train --resume RUN` goes on with a training that was interrupted.
    """

    frame: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FRAME")]
    """A frame of smoke: OpenVDB, or npz as Mantaflow writes it."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    preset: Literal["draft", "standard", "paper"] = "draft"
    """Values of all hyperparameters that are not given."""
    texture: float | None = None
    """Iterations on a solid texture of the picture for each one on the smoke, made before those:
    patterns come from there. 0 begins with nothing."""
    begin_with: Path | None = None
    """A solid texture of the picture that is trained already, to begin with instead."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[SmokeConfig, tyro.conf.arg(name="")] = field(default_factory=SmokeConfig)
    """Hyperparameters."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.texture is not None and not 0 <= self.texture <= 1000:
            raise OptionError(f"--texture {self.texture:g}: must be from 0 to 1000")
        if self.texture is not None and self.begin_with is not None:
            raise OptionError("--texture, --begin-with: one of them, not both")


@dataclass(frozen=True)
class Resume(ResumeOptions):
    """Go on with a training that was interrupted, as if it had not been."""

    frame: Path | None = None
    """The frame, if it is no longer where it was."""
    style: Path | None = None
    """The picture, if it is no longer where it was."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and train, or go on with a training."""
    if is_given(arguments, "--resume"):
        resume(parse(COMMAND, Resume, arguments))
        return
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    defaults = Train(
        frame=missing, style=missing, out=missing, config=PRESETS.get(preset, SmokeConfig())
    )
    train(parse(COMMAND, Train, arguments, default=defaults))


def train(options: Train, checkpoint: Checkpoint | None = None) -> Path:
    """Train as asked, or go on from a checkpoint, and return the path of the run folder.

    Raises:
        VncaError: If an input cannot be used, the run folder cannot be written, training
            diverges, or memory runs out.
    """
    folder = run_folder(options.out, overwrite=options.overwrite, checkpoint=checkpoint)
    style = read_style(options.style)
    device = choose_device(options.device)
    smoke_format = beside(options.frame, options.smoke)
    smoke = read_alone(options.frame, smoke_format)
    if not smoke.density.any():
        raise GridError(
            f"{options.frame}: there is no smoke in this frame to train on; choose a later one"
        )
    config = options.config
    if smoke.velocity is None:
        if smoke_format.velocity_grid != NO_VELOCITY:
            say(f"{missing_velocity(options.frame)}; the rule learns nothing of motion")
        # Or it would be told in painting what training has not told it the meaning of.
        config = dataclasses.replace(
            config, rule=dataclasses.replace(config.rule, velocity_prior=False)
        )
    torch.use_deterministic_algorithms(True)
    network = load_network(config.features, device)
    with fitting(config, "this frame"):
        budget = memory_budget(options.memory_budget)
        trainer = smoke_trainer(smoke, style, config, network, device=device, memory_budget=budget)
    training = {
        "frame": options.frame.name,
        "style": options.style.name,
        "preset": options.preset,
        "seed": config.seed,
        "device": str(device),
        "smoke": dataclasses.asdict(smoke_format),
        **shown_and_judged(trainer, network),
    }
    session = Session(
        command=COMMAND,
        trainer=trainer,
        folder=folder,
        style=style,
        training=training,
        inputs=training_inputs(smoke, style, config, network),
        asked=asked(dataclasses.replace(options, smoke=smoke_format)),
        preview_every=options.preview_every,
    )
    if checkpoint is None or not checkpoint.training:
        if checkpoint is not None:
            checkpoint.require(session.inputs, folder.path / CHECKPOINT_NAME)
        share = SHARES[options.preset] if options.texture is None else options.texture
        beginning = pretraining_config(config, share, trainer.picture_cells)
        if options.begin_with is not None:
            trainer.begin_with(without_prior_weights(_given(options.begin_with, config.rule)))
        elif beginning is not None:
            if checkpoint is None and options.overwrite:
                # Resuming must not take the texture of the run that was there for this one's.
                remove_file(options.out / TEXTURE_FOLDER / MODEL_NAME)
            folder.reserve(Checkpoint({}, session.inputs, COMMAND, session.asked))
            texture = _texture(options, beginning, goes_on=checkpoint is not None)
            trainer.begin_with(without_prior_weights(texture))
        checkpoint = None
    notes = []
    if config.motion.weight and smoke.velocity is not None and not trainer.teaches_motion:
        notes.append(f"{options.frame}: nothing moves in it; its texture is not taught to move")
    session.run(checkpoint, *notes)
    return options.out


def training_inputs(
    smoke: Volume, style: FloatArray, config: SmokeConfig, network: FeatureNetwork
) -> dict[str, str]:
    """What tells a training on smoke from others: the `fingerprints` of what goes into it."""
    frame = [smoke.density, smoke.origin]
    if smoke.velocity is not None:
        frame.append(smoke.velocity)
    return fingerprints(style, config, network, frame=frame)


def _given(path: Path, wanted: RuleConfig) -> Rule:
    """The texture to begin with that was named.

    Raises:
        VncaError: If it cannot be read, or is a rule of another shape.
    """
    rule = Model.load(path).rule
    for name in SHAPE:
        its, ours = (getattr(config, name) for config in (rule.config, wanted))
        if its != ours:
            option = f"--{name.replace('_', '-')}"
            raise OptionError(
                f"--begin-with {path}: was trained with {option} {its:g}; add that, in place of "
                f"{ours:g}"
            )
    return rule


def _texture(options: Train, config: TextureConfig, *, goes_on: bool) -> Rule:
    """The texture to begin with, from the folder in the run's where it is, or may be already."""
    out = options.out / TEXTURE_FOLDER
    say(f"first, a solid texture: {out}")
    try:
        if goes_on and (out / CHECKPOINT_NAME).exists():
            again = texture_train.ResumeTexture(
                resume=out, style=options.style, memory_budget=options.memory_budget
            )
            texture_train.resume(again)
        elif not (goes_on and (out / MODEL_NAME).exists()):
            texture_train.train(
                texture_train.TrainTexture(
                    options.style,
                    config=config,
                    out=out,
                    overwrite=options.overwrite or goes_on,
                    preview_every=options.preview_every,
                    device=options.device,
                    memory_budget=options.memory_budget,
                )
            )
    except KeyboardInterrupt:
        say(f"to go on with all of it: vnca {COMMAND} --resume {options.out}")
        raise
    return Model.load(out).rule


def resume(options: Resume) -> Path:
    """Go on with a training, if there is something left to do, and return the run folder.

    Raises:
        VncaError: If there is no checkpoint, an input changed, or as `train` says.
    """
    left = interrupted(COMMAND, Train, options)
    if left is not None:
        train(*left)
    return options.resume
