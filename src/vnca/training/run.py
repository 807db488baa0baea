"""The folder of a training run: what was asked, how it went, what came out.

Loss curves and previews are written as TensorBoard reads them.
"""

import dataclasses
import json
import os
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import torch

import vnca
from vnca.core import FloatArray
from vnca.core.errors import OutputError
from vnca.core.files import remove_file, remove_leftovers, whole_file, writable_folder
from vnca.io.film import contact_sheet
from vnca.io.picture import resize, write_image
from vnca.rule.model import CONFIG_NAME, MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint, Thrift
from vnca.training.config import TrainingConfig
from vnca.training.loop import Progress, Trainer

PATTERN = "events.out.tfevents.*"
"""What TensorBoard calls a file of curves."""


class Curves:
    """An event file, written point by point.

    TensorBoard's own writer has a thread that writes every two minutes: that much is lost when the
    program is killed, and a full disk ends in a traceback.
    """

    def __init__(self, folder: Path, *, after: int = 0) -> None:
        """Begin a file in a folder; of earlier files only the points up to iteration `after` count.

        Raises:
            OutputError: If it cannot be written.
        """
        from tensorboard.summary.writer.record_writer import RecordWriter

        # TensorBoard reads them in the order of their names: this one has to be the last.
        earlier = [path.name.split(".")[3] for path in folder.glob(PATTERN)]
        begun = max(int(time.time()), *(int(at) + 1 for at in earlier if at.isdecimal()), 0)
        name = f"{begun:010}.{socket.gethostname()}.{os.getpid()}.0"
        self._path = folder / PATTERN.replace("*", name)
        with self._told():
            self._records = RecordWriter(self._path.open("xb"))
        self._write(0, file_version="brain.Event:2")
        self._write(after + 1, session_log={"status": "START"})

    def add(self, iteration: int, values: Mapping[str, float]) -> None:
        """A point on each of some curves.

        Raises:
            OutputError: If it cannot be written.
        """
        self._write_summary(
            iteration, [{"tag": tag, "simple_value": value} for tag, value in values.items()]
        )

    def show(self, iteration: int, tag: str, png: bytes, rows: int, columns: int) -> None:
        """A picture in RGB, as a PNG file has it.

        Raises:
            OutputError: If it cannot be written.
        """
        image = {
            "height": rows,
            "width": columns,
            "colorspace": 3,
            "encoded_image_string": png,
        }
        self._write_summary(iteration, [{"tag": tag, "image": image}])

    def close(self) -> None:
        """End the file."""
        with suppress(OSError):  # What could not be written has been told.
            self._records.close()

    def _write_summary(self, iteration: int, values: list[dict[str, Any]]) -> None:
        self._write(iteration, summary={"value": values})

    def _write(self, iteration: int, **content: Any) -> None:
        from tensorboard.compat.proto.event_pb2 import (
            Event,  # pyright: ignore[reportAttributeAccessIssue]
        )

        event = Event(step=iteration, wall_time=time.time(), **content)
        with self._told():
            self._records.write(event.SerializeToString())
            self._records.flush()

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror})") from error


PREVIEW_SIZE = 256
"""Rows and columns of each picture, pixels."""


def preview_sheet(trainer: Trainer, *styles: FloatArray) -> FloatArray:
    """Each style beside what a state grown from the seed looks like, linear RGB `[r, c, 3]`.

    Leaves the trainer's random streams as they were, so that looking changes nothing.
    """
    rows = []
    for number, style in enumerate(styles):
        state = trainer.grow(2 * trainer.config.longest_rollout, number)
        with torch.no_grad():
            rows.append([_square(style), *trainer.scene.preview_views(state, PREVIEW_SIZE)])
    return contact_sheet(rows)


def _square(style: FloatArray) -> FloatArray:
    """The middle of the style picture, as large as a preview_view."""
    rows, columns = style.shape[:2]
    side = min(rows, columns)
    top, left = (rows - side) // 2, (columns - side) // 2
    return np.clip(
        resize(style[top : top + side, left : left + side], PREVIEW_SIZE, PREVIEW_SIZE), 0, 1
    )


_PREVIEW = "preview_{:06d}.png"
_OF_ONE_RUN = (PATTERN, "preview_[0-9]*.png")


class RunFolder:
    """A run folder, written to while it is a context."""

    def __init__(
        self, path: Path, *, overwrite: bool = False, resumed_from: int | None = None
    ) -> None:
        """Choose a folder; nothing is written until the context begins.

        Args:
            path: The folder.
            overwrite: Replace a run that the folder holds already.
            resumed_from: Go on with the run that the folder holds, from this iteration.

        Raises:
            OutputError: If it cannot be written, or holds a run already and neither is asked for.
        """
        self.path = writable_folder(path)
        self.checkpoint_path = path / CHECKPOINT_NAME
        self._overwrite, self._resumed_from = overwrite, resumed_from
        self._thrift = Thrift()
        if overwrite or resumed_from is not None:
            return
        if (self.path / CHECKPOINT_NAME).exists():
            raise OutputError(
                f"{self.path}: holds a training that was interrupted; go on with `resume` "
                f"{self.path}, or choose another `out` or `overwrite`"
            )
        if (self.path / MODEL_NAME).exists():
            raise OutputError(
                f"{self.path}: holds a trained model already; choose another `out` or `overwrite`"
            )

    def __enter__(self) -> "RunFolder":
        """The folder itself, made if needed, and cleared of an earlier run's curves and previews.

        Raises:
            OutputError: If it cannot be written.
        """
        self._make()
        if self._overwrite:
            for old in chain.from_iterable(map(self.path.glob, _OF_ONE_RUN)):
                remove_file(old)
        self._curves = Curves(self.path, after=self._resumed_from or 0)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the loss curves."""
        self._curves.close()

    def reserve(self, checkpoint: Checkpoint) -> None:
        """Make the folder for a training that is yet to begin, and write what was asked of it.

        Raises:
            OutputError: If it cannot be written.
        """
        self._make()
        self.keep(checkpoint)

    def _make(self) -> None:
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror})") from error

    def start(self, config: TrainingConfig, training: dict[str, Any]) -> None:
        """Write what was asked for: resolved configuration, inputs, version and device."""
        previews = map(_PREVIEW.format, range(config.iterations + 1))
        remove_leftovers(self.path, {CONFIG_NAME, CHECKPOINT_NAME, MODEL_NAME, *previews})
        resolved = {
            "vnca": vnca.__version__,
            "torch": torch.__version__,
            **training,
            "config": dataclasses.asdict(config),
        }
        with whole_file(self.path / CONFIG_NAME) as temporary:
            temporary.write_text(json.dumps(resolved, indent=2) + "\n")

    def log(self, progress: Progress, learning_rate: float) -> None:
        """Add a point to the loss curves."""
        values = {f"loss/{name}": value for name, value in progress.terms.items()}
        values |= {
            "loss/total": progress.loss,
            "state/exploded": float(progress.exploded),
            "learning_rate": learning_rate,
        }
        self._curves.add(progress.iteration, values)

    def preview(self, picture: FloatArray, iteration: int) -> Path:
        """Write a preview picture, linear RGB `[r, c, 3]`, and show it in TensorBoard."""
        path = self.path / _PREVIEW.format(iteration)
        write_image(path, picture)
        rows, columns, _ = picture.shape
        self._curves.show(iteration, "preview", path.read_bytes(), rows, columns)
        return path

    def save(self, model: Model) -> Path:
        """Write the model, whole or not at all."""
        path = self.path / MODEL_NAME
        model.save(path)
        return path

    def keep(self, checkpoint: Checkpoint) -> None:
        """Write what it takes to go on, whole or not at all."""
        with self._thrift.writing():
            checkpoint.save(self.path / CHECKPOINT_NAME)

    @property
    def is_keeping_due(self) -> bool:
        """Whether it is time for another checkpoint."""
        return self._thrift.is_due

    def finish(self) -> None:
        """Remove the checkpoint: the training has come to its end."""
        remove_file(self.path / CHECKPOINT_NAME)


class NoFolder:
    """In the place of a run folder where nothing is to be written."""

    path = None
    checkpoint_path = Path(CHECKPOINT_NAME)
    is_keeping_due = False

    def __enter__(self) -> "NoFolder":
        """Nothing to make."""
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to end."""

    def _ignore(self, *_: object) -> None:
        pass

    reserve = start = log = preview = save = keep = _ignore

    def finish(self) -> None:
        """Nothing to remove."""
