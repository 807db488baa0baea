"""`vnca train FRAME STYLE --out RUN`, and `vnca train --resume RUN`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from traceback import clear_frames
from typing import Annotated, Any, Literal

import torch
import tyro

from vnca.automaton.model import MODEL_NAME, Model
from vnca.cli.options import chosen, is_given, parse, say
from vnca.cli.progress import Progress
from vnca.cli.recorded import recorded, restored
from vnca.cli.sequence import beside
from vnca.errors import (
    DivergenceError,
    FileFormatError,
    GridError,
    OptionError,
    OutOfMemoryError,
    VncaError,
)
from vnca.features.vgg import VGG16
from vnca.io.image import read_image, resize, to_srgb8
from vnca.io.smoke import SmokeFormat, read_smoke
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint, fingerprints
from vnca.training.config import PRESETS, TrainConfig
from vnca.training.loop import Trainer
from vnca.training.memory import is_out_of_memory, memory_advice
from vnca.training.preview import preview_sheet
from vnca.training.run import RunFolder
from vnca.typing import FloatArray

THUMBNAIL = 96
"""Rows and columns of the style picture kept in a model file."""


@dataclass(frozen=True)
class Train:
    """Learn a rule from one frame of smoke and one picture.

    `vnca train --resume RUN` goes on with a training that was interrupted.
    """

    frame: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FRAME")]
    """A frame of smoke: OpenVDB, or npz as Mantaflow writes it."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG or WebP."""
    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    preset: Literal["draft", "standard", "paper"] = "draft"
    """Values of all options below that are not given."""
    overwrite: bool = False
    """Replace the model of an earlier run in the same folder."""
    preview_every: int = 50
    """Iterations between preview pictures, at which the model is saved too."""
    device: str = "auto"
    """Where to compute: auto, cpu or cuda."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[TrainConfig, tyro.conf.arg(name="")] = field(default_factory=TrainConfig)
    """Hyperparameters."""

    def __post_init__(self) -> None:
        if self.preview_every < 1:
            raise OptionError(f"--preview-every {self.preview_every}: at least 1 is needed")


@dataclass(frozen=True)
class Resume:
    """Go on with a training that was interrupted, as if it had not been."""

    resume: Path
    """Folder of the run. All that was asked for when it began holds."""
    frame: Path | None = None
    """The frame, if it is no longer where it was."""
    style: Path | None = None
    """The picture, if it is no longer where it was."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and train, or go on with a training."""
    if is_given(arguments, "--resume"):
        resume(parse("train", Resume, arguments))
        return
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    defaults = Train(
        frame=missing, style=missing, out=missing, config=PRESETS.get(preset, TrainConfig())
    )
    train(parse("train", Train, arguments, default=defaults))


def train(options: Train) -> Path:
    """Train as asked and return the path of the run folder.

    Raises:
        VncaError: If an input cannot be used, the run folder cannot be written, or training
            diverges.
    """
    return _train(options, RunFolder(options.out, overwrite=options.overwrite))


def resume(options: Resume) -> Path:
    """Go on with a training, if there is something left to do, and return the run folder.

    Raises:
        VncaError: If there is no checkpoint, an input changed, or as `train` says.
    """
    path = options.resume / CHECKPOINT_NAME
    if not path.exists():
        if not (options.resume / MODEL_NAME).exists():
            raise FileFormatError(
                f"{options.resume}: no training to go on with here (no {CHECKPOINT_NAME}); "
                "begin one with vnca train FRAME STYLE --out"
            )
        say(f"{options.resume}: this training has come to its end; there is nothing left to do")
        return options.resume
    checkpoint = Checkpoint.load(path)
    try:
        asked = restored(Train, checkpoint.options)
        iteration = int(checkpoint.training["trainer"].values["iteration"])
    except (KeyError, TypeError, ValueError, VncaError) as error:
        raise FileFormatError(
            f"{path}: vnca {checkpoint.version} wrote this checkpoint with other options than "
            f"this one has, or it is damaged ({error})"
        ) from error
    asked = dataclasses.replace(
        asked,
        out=options.resume,
        frame=options.frame or asked.frame,
        style=options.style or asked.style,
    )
    return _train(asked, RunFolder(asked.out, resumed_from=iteration), checkpoint)


def _train(options: Train, run_folder: RunFolder, checkpoint: Checkpoint | None = None) -> Path:
    style = read_image(options.style)
    device = choose_device(options.device)
    smoke_format = beside(options.frame, options.smoke)
    smoke = read_smoke(options.frame, smoke_format)
    if not smoke.density.any():
        raise GridError(
            f"{options.frame}: there is no smoke in this frame to train on; choose a later one"
        )
    torch.use_deterministic_algorithms(True)
    vgg = VGG16.load(options.config.features, device)
    try:
        trainer = Trainer(smoke, style, options.config, vgg, device=device)
    except (MemoryError, RuntimeError) as error:
        if not is_out_of_memory(error):
            raise
        raise OutOfMemoryError(
            f"out of memory before training began, with the frame and views of "
            f"--view.size {options.config.view.size} pixels; lower it, or take a frame with less "
            "smoke"
        ) from error
    training = {
        "frame": options.frame.name,
        "style": options.style.name,
        "preset": options.preset,
        "seed": options.config.seed,
        "device": str(device),
        "smoke": dataclasses.asdict(smoke_format),
        "features": vgg.name,
        "features_origin": vgg.origin,
        "features_dtype": str(vgg.dtype).removeprefix("torch."),
    }
    inputs = fingerprints(smoke, style, options.config, vgg)
    if checkpoint is not None:
        checkpoint.resume(trainer, inputs, run_folder.path / CHECKPOINT_NAME)
    asked = _asked(dataclasses.replace(options, smoke=smoke_format))
    with run_folder as folder:
        session = _Session(trainer, options, folder, style, training, inputs, asked)
        if checkpoint is None:
            session.keep()
        folder.start(options.config, training)
        say(
            f"{len(trainer.scene.domain)} cells, {trainer.rule().weight_count} weights, "
            f"features '{vgg.name}', {device}"
        )
        if options.config.motion.weight and not trainer.scene.moves:
            say(f"{options.frame}: no velocity in this frame; its texture is not taught to move")
        session.improve()
    return options.out


def _asked(options: Train) -> dict[str, Any]:
    """The options as JSON, with paths that hold from any folder."""
    config = options.config
    if Path(config.features).suffix:  # else a name
        config = dataclasses.replace(config, features=str(Path(config.features).absolute()))
    return recorded(
        dataclasses.replace(
            options,
            frame=options.frame.absolute(),
            style=options.style.absolute(),
            out=options.out.absolute(),
            config=config,
        )
    )


@dataclass(frozen=True)
class _Session:
    """A trainer, and what it leaves in the folder of its run."""

    trainer: Trainer
    options: Train
    folder: RunFolder
    style: FloatArray
    training: dict[str, Any]
    inputs: dict[str, str]
    asked: dict[str, Any]

    def improve(self) -> None:
        """Iterate to the end or to Ctrl-C; either way the folder holds a usable model."""
        trainer, folder, total = self.trainer, self.folder, self.options.config.iterations
        progress = Progress("training", total, "iterations", already=trainer.iteration)
        try:
            with progress:
                for step in trainer.run():
                    folder.log(step, trainer.learning_rate)
                    progress.show(step.iteration, f"loss {step.loss:.2f}")
                    if step.diverged:
                        say(self._setback())
                    if step.iteration % self.options.preview_every == 0 and step.iteration < total:
                        self.show()
                    if folder.is_keeping_due:
                        self.keep()
        except KeyboardInterrupt:
            trainer.undo()
            self.keep()
            self.show()
            say(
                f"stopped at iteration {trainer.iteration}; the model so far is in {folder.path}; "
                f"to go on: vnca train --resume {folder.path}"
            )
            raise
        except DivergenceError:  # which would come again
            self.save()
            folder.finish()
            raise
        except (MemoryError, RuntimeError) as error:
            if not is_out_of_memory(error):
                raise
            clear_frames(error.__traceback__)  # They hold on to what was computed.
            trainer.undo()
            self.keep()
            self.save()
            advice = memory_advice(len(trainer.scene.domain), self.options.config)
            raise OutOfMemoryError(
                f"out of memory in iteration {trainer.iteration + 1}: {advice}; to go on from here "
                f"when more is free: vnca train --resume {folder.path}"
            ) from None
        self.show()
        folder.finish()
        say(f"model: {folder.path}")

    def keep(self) -> None:
        """Write a checkpoint."""
        self.folder.keep(Checkpoint(self.trainer.snapshot(), self.inputs, self.asked))

    def show(self) -> None:
        """Write the model and a preview."""
        self.save()
        self.folder.preview(preview_sheet(self.trainer, self.style), self.trainer.iteration)

    def save(self) -> None:
        """Write the model."""
        provenance = {**self.training, "iterations": self.trainer.iteration}
        self.folder.save(Model(self.trainer.rule(), provenance, _small(self.style)))

    def _setback(self) -> str:
        trainer = self.trainer
        return (
            f"training diverged at iteration {trainer.iteration}: back to the weights of iteration "
            f"{trainer.good_iteration}, at half the learning rate"
        )


def _small(style: FloatArray) -> Any:
    rows, columns = style.shape[:2]
    factor = min(1.0, THUMBNAIL / max(rows, columns))
    size = max(1, round(rows * factor)), max(1, round(columns * factor))
    return to_srgb8(resize(style, *size))


def choose_device(name: str) -> torch.device:
    """The device of a name; `auto` takes a GPU where there is one.

    Raises:
        OptionError: If there is no such device.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        raise OptionError(f"--device {name}: not available here; use auto or cpu") from error
    if device.type not in ("cpu", "cuda"):
        raise OptionError(f"--device {name}: expected auto, cpu or cuda")
    return device
