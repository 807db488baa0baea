"""A training in the folder of its run, whatever it is trained on: begun, interrupted, resumed."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from traceback import clear_frames
from typing import Any, TypeVar

from vnca.core import FloatArray
from vnca.core.errors import (
    DivergenceError,
    FileFormatError,
    OptionError,
    OutOfMemoryError,
    VncaError,
)
from vnca.core.memory import memory_budget
from vnca.features import FeatureNetwork
from vnca.io.picture import resize, to_srgb8
from vnca.recipe import COMPARES_REGIONS, PICTURE_CELLS, Watch, recorded, restored
from vnca.rule.mixing import ORIGINS
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint
from vnca.training.config import TrainingConfig
from vnca.training.loop import Trainer
from vnca.training.rollout import is_out_of_memory, memory_advice
from vnca.training.run import NoFolder, RunFolder, preview_sheet

FINGERPRINTS = "fingerprints"
"""What says in the configuration of a run what its inputs were, wherever their files lie."""
"""What tells cuBLAS how much memory to multiply in, and how much runs that are equal may take;
`import vnca` sets it."""
THUMBNAIL = 96
"""Rows and columns of the style picture kept in a model file."""


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """What is asked of a training, whatever it is trained on."""

    out: Path | None
    """Folder of the run: model, configuration, previews and loss curves."""
    overwrite: bool = False
    """Replace the model of an earlier run in the same folder."""
    preview_every: int = 50
    """Iterations between preview pictures, at which the model is saved too."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    memory_budget: str = "auto"
    """Memory for the program, such as 12GB (on a GPU: of the GPU): what does not fit of a rollout
    is computed again, with the same result. auto takes what is free."""

    def __post_init__(self) -> None:
        if self.preview_every < 1:
            raise OptionError(f"`preview_every` {self.preview_every}: at least 1 is needed")
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
    """A trainer, and what it leaves in the folder of its run, if it has one.

    Attributes:
        command: The command that begins it or goes on with it, without `vnca`.
        trainer: What is trained.
        folder: Where models, previews and checkpoints go.
        styles: The pictures, linear RGB `[r, c, 3]`.
        training: What the model file tells of where it comes from.
        inputs: What `fingerprints` gave.
        asked: What was asked for, as JSON values.
        preview_every: Iterations between preview pictures.
        watch: Is told how far it has come.
    """

    command: str
    trainer: Trainer
    folder: RunFolder | NoFolder
    styles: Sequence[FloatArray]
    training: dict[str, Any]
    inputs: Mapping[str, str]
    asked: Mapping[str, Any]
    preview_every: int
    watch: Watch

    @classmethod
    def begun(
        cls,
        options: TrainingOptions,
        kind: type[TrainingOptions],
        command: str,
        trainer: Trainer,
        network: FeatureNetwork,
        *,
        folder: RunFolder | NoFolder,
        styles: Sequence[FloatArray],
        training: Mapping[str, Any],
        inputs: Mapping[str, str],
        watch: Watch,
    ) -> "Session":
        """A session as its options ask for it.

        Args:
            options: An instance of `kind`, or of a subclass that adds what need not be known.
            kind: What is asked of such a training.
            command: See above.
            trainer: See above.
            network: What compares pictures.
            folder: See above.
            styles: See above.
            training: What the model file tells beside the network and the size of the picture.
            inputs: See above.
            watch: See above.
        """
        return cls(
            command,
            trainer,
            folder,
            styles,
            {**training, **shown_and_judged(trainer, network)},
            inputs,
            asked(kind, options),
            options.preview_every,
            watch,
        )

    def run(self, checkpoint: Checkpoint | None, *notes: str) -> Model:
        """Train from the beginning or from a checkpoint on, to the end or to Ctrl-C.

        Either way the folder holds a usable model. `notes` are told first.

        Raises:
            VncaError: If the checkpoint does not fit, the folder cannot be written, training
                diverges, or memory runs out.
        """
        trainer = self.trainer
        if checkpoint is not None:
            checkpoint.resume(trainer, self.inputs, self.folder.checkpoint_path)
        with self.folder:
            if checkpoint is None:
                self._keep()
            known = ("frame", "more_frames", "style", "more_styles")
            inputs = {name: self.asked[name] for name in known if self.asked.get(name)}
            facts = {**self.training, "inputs": inputs, FINGERPRINTS: self.inputs}
            self.folder.start(trainer.config, facts)
            smoke = " + ".join(str(len(scene.domain)) for scene in trainer.scenes)
            self.watch.note(
                f"{smoke} cells, {trainer.rule().weight_count} weights, "
                f"features '{self.training['features']}', {self.training['device']}"
            )
            chosen = "" if trainer.config.appearance.style_scale else ", chosen by its strokes"
            cells = ", ".join(f"{cells:.0f}" for cells in trainer.picture_cells)
            scales = " ".join(f"{one.style_scale:.2f}" for one in trainer.appearances)
            what = "the picture is" if len(self.styles) == 1 else "the pictures are"
            self.watch.note(
                f"{what} {cells} cells wide{chosen} (`appearance.style_scale` {scales})"
            )
            for note in notes:
                self.watch.note(note)
            self._improve()
        return self._model()

    def _improve(self) -> None:
        trainer, folder, total = self.trainer, self.folder, self.trainer.config.iterations
        progress = partial(self.watch.progress, "training", total=total, unit="iterations")
        try:
            progress(trainer.iteration)
            for step in trainer.run():
                folder.log(step, trainer.learning_rate)
                if step.diverged:
                    self.watch.note(self._rollback())
                if step.iteration % self.preview_every == 0 and step.iteration < total:
                    self._show()
                if folder.is_keeping_due:
                    self._keep()
                progress(step.iteration, note=f"loss {step.loss:.2f}")
        except KeyboardInterrupt:
            trainer.undo()
            self._keep()
            self._show()
            if folder.path is not None:
                self.watch.note(
                    f"stopped at iteration {trainer.iteration}; the model so far is in "
                    f"{folder.path}; to go on: {self._call}"
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
            advice = memory_advice(trainer.scenes, trainer.config, trainer.kept_states)
            going_on = (
                f"to go on from here when more is free, or with a `memory_budget`: {self._call}"
                if folder.path is not None
                else "set a `memory_budget`, or `out` to be able to go on from here"
            )
            raise OutOfMemoryError(
                f"out of memory in iteration {trainer.iteration + 1}: {advice}; {going_on}"
            ) from None
        self._show()
        folder.finish()
        if folder.path is not None:
            self.watch.made("model", folder.path)

    @property
    def _call(self) -> str:
        return f"vnca {self.command} `resume` {self.folder.path}"

    def _keep(self) -> None:
        """Write a checkpoint."""
        if self.folder.path is None:
            return
        snapshot = self.trainer.snapshot()
        self.folder.keep(Checkpoint(snapshot, self.inputs, self.command, self.asked))

    def _show(self) -> None:
        """Write the model and a preview."""
        self._save()
        if self.folder.path is not None:
            self.folder.preview(preview_sheet(self.trainer, *self.styles), self.trainer.iteration)

    def _save(self) -> None:
        """Write the model."""
        self.folder.save(self._model())

    def _model(self) -> Model:
        provenance = {**self.training, "iterations": self.trainer.iteration}
        if self.trainer.origins:
            provenance[ORIGINS] = list(self.trainer.origins)
        style, *others = map(_small, self.styles)
        return Model(self.trainer.rule(), provenance, style, more_styles=tuple(others))

    def _rollback(self) -> str:
        trainer = self.trainer
        return (
            f"training diverged at iteration {trainer.iteration}: back to the weights of iteration "
            f"{trainer.good_iteration}, at half the learning rate"
        )


def interrupted(
    command: str, kind: type[T], options: ResumeOptions, watch: Watch
) -> tuple[T, Checkpoint] | None:
    """What is asked of an interrupted training, and where it was left; None if it has ended.

    Args:
        command: The command that goes on, without `vnca`.
        kind: The options it begins with.
        options: What is asked now; it takes the place of what was asked first.
        watch: Is told if there is nothing left to do.

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
        watch.note(f"{folder}: this training has come to its end; there is nothing left to do")
        return None
    checkpoint = Checkpoint.load(path)
    if checkpoint.command != command:
        raise FileFormatError(
            f"{path}: was written by vnca {checkpoint.command}; go on with "
            f"vnca {checkpoint.command} `resume` {folder}"
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


def run_folder(
    path: Path | None, *, overwrite: bool, checkpoint: Checkpoint | None
) -> RunFolder | NoFolder:
    """The folder of a new training, or of one that goes on; none where nothing is to be written.

    Raises:
        OutputError: If it cannot be written, or holds a run that may not be replaced.
        FileFormatError: If the checkpoint is damaged.
    """
    if path is None:
        return NoFolder()
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


def asked(kind: type[TrainingOptions], options: Any) -> dict[str, Any]:
    """The options of a training as JSON, with paths that hold from any folder.

    Args:
        kind: What is asked of such a training; a subclass may add to it what need not be known.
        options: An instance.
    """
    config: TrainingConfig = options.config
    if Path(config.features).suffix:  # else a name
        config = dataclasses.replace(config, features=str(Path(config.features).absolute()))
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(kind)}
    paths: dict[str, Any] = {n: v.absolute() for n, v in given.items() if isinstance(v, Path)}
    for name in ("more_styles", "more_frames"):
        if name in given:
            paths[name] = tuple(path.absolute() for path in given[name])
    return recorded(kind(**{**given, **paths, "config": config}))


def shown_and_judged(trainer: Trainer, network: FeatureNetwork) -> dict[str, Any]:
    """What a model file tells of how large its picture was shown, and of what compared with it."""
    return {
        PICTURE_CELLS: round(trainer.picture_cells[0], 2),
        COMPARES_REGIONS: trainer.config.appearance.regions > 0,
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
            f"out of memory before training began, with {what} and pictures of `{seen.option}` "
            f"{seen.size} pixels; lower it, or take a smaller {what.split()[-1]}"
        ) from error


def _small(style: FloatArray) -> Any:
    rows, columns = style.shape[:2]
    factor = min(1.0, THUMBNAIL / max(rows, columns))
    size = max(1, round(rows * factor)), max(1, round(columns * factor))
    return to_srgb8(resize(style, *size))
