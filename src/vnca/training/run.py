"""The folder of a training run: what was asked, how it went, what came out."""

import dataclasses
import json
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any

import torch

import vnca
from vnca.automaton.model import MODEL_NAME, Model
from vnca.errors import OutputError
from vnca.files import whole_file, writable_folder
from vnca.io.image import to_srgb8, write_image
from vnca.training.config import TrainConfig
from vnca.training.loop import Progress
from vnca.typing import FloatArray

CONFIG_NAME = "config.json"
_OF_ONE_RUN = ("events.out.tfevents.*", "preview_[0-9]*.png")


class RunFolder:
    """A run folder, written to while it is a context."""

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        """Choose a folder; nothing is written until the context begins.

        Raises:
            OutputError: If it cannot be written, or holds a model already and may not be
                overwritten.
        """
        self.path = writable_folder(path)
        self._overwrite = overwrite
        if (self.path / MODEL_NAME).exists() and not overwrite:
            raise OutputError(
                f"{self.path}: holds a trained model already; choose another --out or --overwrite"
            )

    def __enter__(self) -> "RunFolder":
        """The folder itself, made if needed, and cleared of an earlier run's curves and previews.

        Raises:
            OutputError: If it cannot be written.
        """
        from torch.utils.tensorboard.writer import SummaryWriter

        try:
            self.path.mkdir(parents=True, exist_ok=True)
            if self._overwrite:
                for old in chain.from_iterable(map(self.path.glob, _OF_ONE_RUN)):
                    old.unlink()
            self._events = SummaryWriter(str(self.path))
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror})") from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Flush the loss curves."""
        self._events.close()

    def start(self, config: TrainConfig, training: dict[str, Any]) -> None:
        """Write what was asked for: resolved configuration, inputs, version and device."""
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
        at = progress.iteration
        self._events.add_scalar("loss/total", progress.loss, at)
        for name, value in progress.terms.items():
            self._events.add_scalar(f"loss/{name}", value, at)
        self._events.add_scalar("state/exploded", float(progress.exploded), at)
        self._events.add_scalar("learning_rate", learning_rate, at)

    def preview(self, picture: FloatArray, iteration: int) -> Path:
        """Write a preview picture, linear RGB `[r, c, 3]`, and show it in TensorBoard."""
        path = self.path / f"preview_{iteration:06d}.png"
        write_image(path, picture)
        self._events.add_image("preview", to_srgb8(picture), iteration, dataformats="HWC")
        return path

    def save(self, model: Model) -> Path:
        """Write the model, whole or not at all."""
        path = self.path / MODEL_NAME
        model.save(path)
        return path
