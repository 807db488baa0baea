"""A training on the command line, whatever it is trained on: its course, and going on with it."""

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from traceback import clear_frames
from typing import Any, TypeVar

import torch

from vnca.cli.options import say
from vnca.cli.progress import Progress, made
from vnca.cli.recorded import PICTURE_CELLS, recorded, restored
from vnca.core.errors import (
    DivergenceError,
    FileFormatError,
    OptionError,
    OutOfMemoryError,
    VncaError,
)
from vnca.core.typing import FloatArray
from vnca.features.network import FeatureNetwork
from vnca.io.picture import resize, to_srgb8
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint
from vnca.training.config import TrainingConfig
from vnca.training.loop import Trainer
from vnca.training.memory import is_out_of_memory, memory_advice, memory_budget
from vnca.training.preview import preview_sheet
from vnca.training.run import RunFolder

FINGERPRINTS = "fingerprints"
"""What says in the configuration of a run what its inputs were, wherever their files lie."""
THUMBNAIL = 96
"""Rows and columns of the style picture kept in a model file."""


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """What is asked of a training, whatever it is trained on."""

    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    overwrite: bool = False
    """Replace the model of an earlier run in the same folder."""
    preview_every: int = 50
    """Iterations between preview pictures, at which the model is saved too."""
    device: str = "auto"
    """Where to compute: auto, cpu or cuda."""
    memory_budget: str = "auto"
    """Memory for the program, such as 12GB (on a GPU: of the GPU): what does not fit of a rollout
    is computed again, with the same result. auto takes what is free."""

    def __post_init__(self) -> None:
        if self.preview_every < 1:
            raise OptionError(f"--preview-every {self.preview_every}: at least 1 is needed")
        memory_budget(self.memory_budget)


@dataclass(frozen=True, kw_only=True)
class ResumeOptions:
    """What may be asked when a training goes on; all else holds as it was asked for first.

    Fields of its subclasses are named as those that they take the place of.
    """

    resume: Path
    """Folder of the run. All that was asked for when it began holds."""
    memory_budget: str | None = None
    """Memory for the program from now on, such as 12GB or auto."""


T = TypeVar("T", bound=TrainingOptions)


@dataclass(frozen=True)
class Session:
    """A trainer, and what it leaves in the folder of its run.

    Attributes:
        command: What is called to begin or to go on, without `vnca`.
        trainer: What is trained.
        folder: Where it leaves what it leaves.
        style: The picture, linear RGB `[r, c, 3]`.
        training: What the model file tells of where it comes from.
        inputs: What `fingerprints` gave.
        asked: What was asked for, as JSON values.
        preview_every: Iterations between preview pictures.
    """

    command: str
    trainer: Trainer
    folder: RunFolder
    style: FloatArray
    training: dict[str, Any]
    inputs: Mapping[str, str]
    asked: Mapping[str, Any]
    preview_every: int

    def run(self, checkpoint: Checkpoint | None, *notes: str) -> None:
        """Train from the beginning or from a checkpoint on, to the end or to Ctrl-C.

        Whichever it is, the folder holds a usable model. `notes` are told first.

        Raises:
            VncaError: If the checkpoint does not fit, the folder cannot be written, training
                diverges, or memory runs out.
        """
        trainer = self.trainer
        if checkpoint is not None:
            checkpoint.resume(trainer, self.inputs, self.folder.path / CHECKPOINT_NAME)
        with self.folder:
            if checkpoint is None:
                self._keep()
            inputs = {name: self.asked[name] for name in ("frame", "style") if name in self.asked}
            facts = {**self.training, "inputs": inputs, FINGERPRINTS: self.inputs}
            self.folder.start(trainer.config, facts)
            say(
                f"{len(trainer.scene.domain)} cells, {trainer.rule().weight_count} weights, "
                f"features '{self.training['features']}', {self.training['device']}"
            )
            chosen = "" if trainer.config.appearance.style_scale else ", chosen by its strokes"
            say(
                f"the picture is {trainer.picture_cells:.0f} cells wide{chosen} "
                f"(--appearance.style-scale {trainer.style_scale:.2f})"
            )
            for note in notes:
                say(note)
            self._improve()

    def _improve(self) -> None:
        trainer, folder, total = self.trainer, self.folder, self.trainer.config.iterations
        progress = Progress("training", total, "iterations", already=trainer.iteration)
        try:
            with progress:
                for step in trainer.run():
                    folder.log(step, trainer.learning_rate)
                    progress.show(step.iteration, f"loss {step.loss:.2f}")
                    if step.diverged:
                        say(self._setback())
                    if step.iteration % self.preview_every == 0 and step.iteration < total:
                        self._show()
                    if folder.is_keeping_due:
                        self._keep()
        except KeyboardInterrupt:
            trainer.undo()
            self._keep()
            self._show()
            say(
                f"stopped at iteration {trainer.iteration}; the model so far is in {folder.path}; "
                f"to go on: {self._call}"
            )
            raise
        except DivergenceError:  # which would come again
            self._save()
            folder.finish()
            raise
        except (MemoryError, RuntimeError) as error:
            if not is_out_of_memory(error):
                raise
            clear_frames(error.__traceback__)  # They hold on to what was computed.
            trainer.undo()
            self._keep()
            self._save()
            advice = memory_advice(trainer.scene, trainer.config, trainer.kept_states)
            raise OutOfMemoryError(
                f"out of memory in iteration {trainer.iteration + 1}: {advice}; to go on from here "
                f"when more is free, or with a --memory-budget: {self._call}"
            ) from None
        self._show()
        folder.finish()
        made("model", folder.path)

    @property
    def _call(self) -> str:
        return f"vnca {self.command} --resume {self.folder.path}"

    def _keep(self) -> None:
        """Write a checkpoint."""
        snapshot = self.trainer.snapshot()
        self.folder.keep(Checkpoint(snapshot, self.inputs, self.command, self.asked))

    def _show(self) -> None:
        """Write the model and a preview."""
        self._save()
        self.folder.preview(preview_sheet(self.trainer, self.style), self.trainer.iteration)

    def _save(self) -> None:
        """Write the model."""
        provenance = {**self.training, "iterations": self.trainer.iteration}
        self.folder.save(Model(self.trainer.rule(), provenance, _small(self.style)))

    def _setback(self) -> str:
        trainer = self.trainer
        return (
            f"training diverged at iteration {trainer.iteration}: back to the weights of iteration "
            f"{trainer.good_iteration}, at half the learning rate"
        )


def interrupted(command: str, kind: type[T], options: ResumeOptions) -> tuple[T, Checkpoint] | None:
    """What is asked of an interrupted training, and where it was left; None if it has ended.

    Args:
        command: The command that goes on, without `vnca`.
        kind: The options it begins with.
        options: What is asked now; it takes the place of what was asked first.

    Raises:
        FileFormatError: If there is no training to go on with, or it is another command's.
        OptionError: If what is asked now cannot be.
    """
    folder = options.resume
    path = folder / CHECKPOINT_NAME
    if not path.exists():
        if not (folder / MODEL_NAME).exists():
            raise FileFormatError(
                f"{folder}: no training to go on with here (no {CHECKPOINT_NAME}); "
                f"begin one with vnca {command}"
            )
        say(f"{folder}: this training has come to its end; there is nothing left to do")
        return None
    checkpoint = Checkpoint.load(path)
    if checkpoint.command != command:
        raise FileFormatError(
            f"{path}: was written by vnca {checkpoint.command}; go on with "
            f"vnca {checkpoint.command} --resume {folder}"
        )
    try:
        begun = restored(kind, checkpoint.options)
    except (KeyError, TypeError, ValueError, VncaError) as error:
        raise FileFormatError(
            f"{path}: vnca {checkpoint.version} wrote this checkpoint with other options than "
            f"this one has, or it is damaged ({error})"
        ) from error
    fields = (field.name for field in dataclasses.fields(options) if field.name != "resume")
    given = {name: getattr(options, name) for name in fields}
    changed = {name: value for name, value in given.items() if value is not None}
    return dataclasses.replace(begun, out=folder, **changed), checkpoint


def run_folder(path: Path, *, overwrite: bool, checkpoint: Checkpoint | None) -> RunFolder:
    """The folder of a new training, or of one that goes on.

    Raises:
        OutputError: If it cannot be written, or holds a run that may not be replaced.
        FileFormatError: If the checkpoint is damaged.
    """
    if checkpoint is None:
        return RunFolder(path, overwrite=overwrite)
    if not checkpoint.training:  # It was interrupted before its first iteration.
        return RunFolder(path, resumed_from=0)
    try:
        iteration = int(checkpoint.training["trainer"].values["iteration"])
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            f"{path / CHECKPOINT_NAME}: the checkpoint is damaged ({error})"
        ) from error
    return RunFolder(path, resumed_from=iteration)


def asked(options: Any) -> dict[str, Any]:
    """The options of a training as JSON, with paths that hold from any folder."""
    config: TrainingConfig = options.config
    if Path(config.features).suffix:  # else a name
        config = dataclasses.replace(config, features=str(Path(config.features).absolute()))
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    paths = {name: value.absolute() for name, value in given.items() if isinstance(value, Path)}
    return recorded(dataclasses.replace(options, **paths, config=config))


def shown_and_judged(trainer: Trainer, network: FeatureNetwork) -> dict[str, Any]:
    """What a model file tells of how large its picture was shown, and of what compared with it."""
    return {
        PICTURE_CELLS: round(trainer.picture_cells, 2),
        "features": network.name,
        "features_origin": network.origin,
        "features_dtype": str(network.dtype).removeprefix("torch."),
    }


@contextmanager
def fitting(config: TrainingConfig, what: str) -> Iterator[None]:
    """While a trainer is made of `what` is trained on.

    Raises:
        OutOfMemoryError: If memory runs out, with one line for the user.
    """
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        if not is_out_of_memory(error):
            raise
        seen = config.pictures
        raise OutOfMemoryError(
            f"out of memory before training began, with {what} and pictures of --{seen.option} "
            f"{seen.size} pixels; lower it, or take a smaller {what.split()[-1]}"
        ) from error


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


def _small(style: FloatArray) -> Any:
    rows, columns = style.shape[:2]
    factor = min(1.0, THUMBNAIL / max(rows, columns))
    size = max(1, round(rows * factor)), max(1, round(columns * factor))
    return to_srgb8(resize(style, *size))
