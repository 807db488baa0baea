"""The checkpoint of a run: all it takes to go on, as safetensors with JSON metadata.

Data only, never code; named tensors of every part of the training, one after the other.
"""

import dataclasses
import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

import vnca
from vnca.core import AnyArray, FloatArray
from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file, whole_file
from vnca.features import FeatureNetwork
from vnca.training import Snapshot
from vnca.training.config import TrainingConfig
from vnca.training.loop import Trainer

CHECKPOINT_NAME = "checkpoint.safetensors"
"""Name of the checkpoint in a run folder."""
FORMAT_VERSION = 1

_METADATA = "vnca_checkpoint"


@dataclass(frozen=True)
class Checkpoint:
    """A training that was left, and what it was about.

    Attributes:
        training: What `Trainer.snapshot` gave; nothing if training had not begun.
        inputs: What `fingerprints` gave.
        command: The command that began it.
        options: What was asked for, to ask for it again; JSON values.
        version: The `vnca` that wrote the file.
    """

    training: Mapping[str, Snapshot]
    inputs: Mapping[str, str]
    command: str
    options: Mapping[str, Any]
    version: str = vnca.__version__

    def save(self, path: Path) -> None:
        """Write the checkpoint, whole or not at all.

        Raises:
            OutputError: If it cannot be written.
        """
        tensors = {
            f"{part}.{name}": tensor.cpu().contiguous()
            for part, snapshot in self.training.items()
            for name, tensor in snapshot.tensors.items()
        }
        described = {
            "format_version": FORMAT_VERSION,
            "version": self.version,
            "inputs": self.inputs,
            "command": self.command,
            "options": self.options,
            "values": {part: snapshot.values for part, snapshot in self.training.items()},
        }
        with whole_file(path) as temporary:
            # `save_file` writes beside it under a name of its own, which stays if it is killed.
            temporary.write_bytes(save(tensors, metadata={_METADATA: json.dumps(described)}))

    @classmethod
    def load(cls, path: Path) -> "Checkpoint":
        """Read a checkpoint. Whether it fits its inputs is for `resume` to say.

        Raises:
            FileFormatError: If it is missing, not a checkpoint, damaged, or of a newer format.
        """
        existing_file(path)
        try:
            with safe_open(path, framework="pt") as file:
                described = json.loads((file.metadata() or {})[_METADATA])
                # Copies: what is read is not to change or vanish with the file.
                tensors = {n: file.get_tensor(n).clone() for n in file.keys()}  # noqa: SIM118
            version = described["format_version"]
            if version > FORMAT_VERSION:
                raise FileFormatError(
                    f"{path}: checkpoint format {version} is newer than this vnca reads "
                    f"({FORMAT_VERSION}); upgrade vnca"
                )
            return cls(
                training={
                    part: Snapshot(_of_part(tensors, part), dict(values))
                    for part, values in described["values"].items()
                },
                inputs=dict(described["inputs"]),
                command=str(described["command"]),
                options=dict(described["options"]),
                version=str(described["version"]),
            )
        except (
            *(SafetensorError, OSError, RecursionError),
            *(AttributeError, KeyError, RuntimeError, TypeError, ValueError),
        ) as error:
            raise FileFormatError(f"{path}: not a vnca checkpoint, or damaged ({error})") from error

    def resume(self, trainer: Trainer, inputs: Mapping[str, str], path: Path) -> None:
        """Take a new trainer to where this one was left.

        Args:
            trainer: Made of inputs that are as they were.
            inputs: Its `fingerprints`.
            path: The file this was read from, to tell.

        Raises:
            OptionError: If an input is not what it was.
            FileFormatError: If the checkpoint is damaged.
        """
        self.require(inputs, path)
        try:
            trainer.restore(self.training)
        except (KeyError, OverflowError, RuntimeError, TypeError, ValueError) as error:
            raise FileFormatError(f"{path}: the checkpoint is damaged ({error})") from error

    def require(self, inputs: Mapping[str, str], path: Path) -> None:
        """Hold inputs to those of the training that was left; arguments as of `resume`.

        Raises:
            OptionError: If an input is not what it was.
        """
        names = dict.fromkeys([*inputs, *self.inputs])
        changed = [name for name in names if self.inputs.get(name) != inputs.get(name)]
        if changed:
            raise OptionError(
                f"{path}: the {' and the '.join(changed)} changed since this training began; put "
                "back what was there, or train anew with `overwrite`"
            )


def _of_part(tensors: Mapping[str, Tensor], part: str) -> dict[str, Tensor]:
    start = f"{part}."
    return {name[len(start) :]: t for name, t in tensors.items() if name.startswith(start)}


def fingerprints(
    style: FloatArray | Sequence[FloatArray],
    config: TrainingConfig,
    network: FeatureNetwork,
    **others: Sequence[AnyArray | tuple[int, ...]],
) -> dict[str, str]:
    """What tells each input of a training from another, wherever its file lies.

    `style` is one picture, or several; `others` are the arrays of all other inputs, by what they
    are.
    """
    options = {k: v for k, v in dataclasses.asdict(config).items() if k != "features"}
    return {
        **{name: _digest(*arrays) for name, arrays in others.items()},
        "style picture": _digest(*([style] if isinstance(style, np.ndarray) else style)),
        "options": hashlib.sha256(json.dumps(options).encode()).hexdigest(),
        "network that compares": network.origin,
    }


def _digest(*arrays: AnyArray | tuple[int, ...]) -> str:
    digest = hashlib.sha256()
    for array in map(np.ascontiguousarray, arrays):
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()


class Thrift:
    """Says when a checkpoint is due, so that they take little of the time and of the disk.

    It goes by the clock, which changes when checkpoints are written, not what is in them.
    """

    share = 0.01
    """Part of the time that may be spent on writing them."""
    least_seconds = 30.0
    """Time between them even where they cost nothing."""

    def __init__(self) -> None:
        """Begin as if one had just been written at no cost."""
        self._due = time.monotonic() + self.least_seconds

    @property
    def is_due(self) -> bool:
        """Whether it is time for another."""
        return time.monotonic() >= self._due

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Measures what one costs while it is written; the next is due accordingly."""
        start = time.monotonic()
        yield
        end = time.monotonic()
        self._due = end + max(self.least_seconds, (end - start) / self.share)
