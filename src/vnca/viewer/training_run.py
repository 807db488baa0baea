"""What a page is told of a training that goes on: how far it is, its curves, and its model."""

import json
import struct
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.rule import Rule, RuleConfig, Scales, density_scale, gamma_for_cell_opacity
from vnca.rule.model import CONFIG_NAME, MODEL_NAME, Model

MOST_POINTS = 300
"""Of a curve: as many as a small picture of it shows."""
_LOSS = "loss/"
_OPAQUE = 0.95


def progress(folder: Path) -> bytes:
    """JSON for the page: iterations done and asked for, losses by name, which model there is."""
    curves: dict[str, dict[int, float]] = {}
    for event in _events(folder):
        for value in event.summary.value:
            if value.tag.startswith(_LOSS):
                # Points that were written again, after an interruption, take the place of others.
                curves.setdefault(value.tag.removeprefix(_LOSS), {})[event.step] = _number(value)
    points = {name: sorted(curve.items()) for name, curve in curves.items()}
    told = {
        "model": str(_changed(folder / MODEL_NAME)),
        "iteration": max((curve[-1][0] for curve in points.values()), default=0),
        "iterations": _asked(folder),
        "curves": {name: _thinned(curve) for name, curve in points.items()},
    }
    return json.dumps(told).encode()


def _number(value: Any) -> float:
    return float(value.simple_value)


def _thinned(curve: list[tuple[int, float]]) -> list[tuple[int, float]]:
    """Some of the points, the last among them; JSON has no word for what is not finite."""
    finite = [point for point in curve if np.isfinite(point[1])]
    step = -(-len(finite) // MOST_POINTS) or 1
    return finite[::-1][::step][::-1]


def _changed(path: Path) -> int:
    """When a file was written, or 0."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _asked(folder: Path) -> int:
    """How many iterations were asked for, or 0."""
    try:
        return int(json.loads((folder / CONFIG_NAME).read_text())["config"]["iterations"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0


def _events(folder: Path) -> Iterator[Any]:
    """What TensorBoard's files of a folder hold, in the order in which it reads them."""
    from tensorboard.compat.proto.event_pb2 import (
        Event,  # pyright: ignore[reportAttributeAccessIssue]
    )

    from vnca.training.run import PATTERN

    files = sorted(folder.glob(PATTERN))
    for record in chain.from_iterable(map(_records, files)):
        yield Event.FromString(record)


def _records(path: Path) -> Iterator[bytes]:
    """The records of a file; one that is being written is left out.

    Each is its length, a checksum of that, the record, and a checksum of it.
    """
    data = path.read_bytes()
    at = 0
    while at + 12 <= len(data):
        (length,) = struct.unpack_from("<Q", data, at)
        end = at + 12 + length + 4
        if end > len(data):
            return
        yield data[at + 12 : end - 4]
        at = end


def untaught(density: AnyArray, path: Path) -> bytes:
    """The model file of a rule that has learned nothing yet: grey smoke as dense as it comes.

    Args:
        density: Of the frame that is trained on, any shape.
        path: A file that may be written and removed.
    """
    scale = density_scale(density)
    gamma = gamma_for_cell_opacity(density / scale, _OPAQUE)
    rule = Rule.initial(RuleConfig(), Scales(density=scale, gamma=gamma), seed=0)
    Model(rule).save(path)
    content = path.read_bytes()
    path.unlink()
    return content
