"""How far the painting of a sequence has come, in a small file beside it: data, never code."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file, whole_file
from vnca.direction import Carried
from vnca.painting import Roll
from vnca.painting.state import RollState

_METADATA = "vnca"
_LONGEST_VALUE = 40
_ANEW, _OTHER_STATE = "start anew without `resume`", "name another as `state_in`"
_CELLS, _VALUES = "cells.{}", "values.{}"
_CARRIED_CELLS, _CARRIED = "carried cells", "carried "


class Source(NamedTuple):
    """The file a finished frame was painted from, as it was then."""

    frame: int
    """Which one of the sequence, counted from 0: the frame's own, or an earlier one held."""
    size: int
    """Bytes."""
    changed: int
    """When it was changed last, nanoseconds."""


@dataclass(frozen=True, eq=False)
class Unfinished:
    """A painting as its last finished frame left it.

    Attributes:
        conditions: What must be the same to go on, by the name a user knows it by; JSON values.
        sources: Of each finished frame, from the first; None for one that was left out.
        state: What the next frame goes on from.
    """

    conditions: Mapping[str, Any]
    sources: tuple[Source | None, ...]
    state: RollState

    def save(self, path: Path) -> None:
        """Write it, whole or not at all.

        Raises:
            OutputError: If it cannot be written.
        """
        states = (self.state, *self.state.layers)
        described = {
            "conditions": self.conditions,
            "sources": self.sources,
            "steps_done": [state.steps_done for state in states],
            "frames": [state.frame for state in states],
        }
        tensors = _carried_tensors(self.state.carried)
        for number, state in enumerate(states):
            tensors[_CELLS.format(number)] = np.ascontiguousarray(state.cells)
            tensors[_VALUES.format(number)] = np.ascontiguousarray(state.values[:-1])
        with whole_file(path) as temporary:
            # Not by safetensors itself, which has an error of its own for a full disk.
            temporary.write_bytes(save(tensors, {_METADATA: json.dumps(described)}))

    @classmethod
    def load(
        cls, path: Path, conditions: Mapping[str, Any], roll: Roll, *, handed_over: bool = False
    ) -> "Unfinished":
        """Read it, if it can be gone on from under these conditions.

        Args:
            path: Where it is.
            conditions: What has to be the same.
            roll: What goes on.
            handed_over: From one chunk to the next, rather than left by an end.

        Raises:
            OptionError: If another condition held when the painting was begun.
            FileFormatError: If the file is missing or damaged.
        """
        path = existing_file(path)
        where, instead = (path, _OTHER_STATE) if handed_over else (path.parent, _ANEW)
        try:
            with safe_open(path, framework="numpy") as file:
                described = json.loads((file.metadata() or {})[_METADATA])
                _require_same(where, described["conditions"], conditions, instead)
                sources = tuple(s and Source(*map(int, s)) for s in described["sources"])
                rolls, steps = (roll, *roll.layers), described["steps_done"]
                state, *layers = (
                    _state(
                        file.get_tensor(_CELLS.format(number)),
                        file.get_tensor(_VALUES.format(number)),
                        int(done),
                        frame,
                        each,
                    )
                    for number, (each, done, frame) in enumerate(
                        zip(rolls, steps, described["frames"], strict=True)
                    )
                )
                carried = _carried({n: file.get_tensor(n) for n in file.keys()})  # noqa: SIM118
                state = replace(state, layers=tuple(layers), carried=carried)
        except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"{path}: damaged ({error}); {instead}") from error
        return cls(conditions, sources, state)


def _require_same(
    where: Path, before: Mapping[str, Any], now: Mapping[str, Any], instead: str
) -> None:
    # As they come back from JSON, where tuples are lists.
    now = json.loads(json.dumps(now))
    for name in {**now, **before}:
        was, is_now = (json.dumps(values.get(name)) for values in (before, now))
        if was != is_now:
            is_short = len(was) + len(is_now) <= _LONGEST_VALUE
            raise OptionError(
                f"{where}: cannot go on, since {name} is another than when the painting was begun"
                f"{f' ({was}, now {is_now})' * is_short}; make it the same or {instead}"
            )


def _state(cells: Any, values: Any, steps_done: int, frame: Any, roll: Roll) -> RollState:
    """The state, after a look at what a damaged file could do harm with.

    Raises:
        ValueError: If it does not fit the rule and the box of the sequence.
    """
    box = roll.box.grown(roll.rule.config.dilation)
    shapes = (len(cells), 3), (len(cells), roll.rule.config.channels)
    if (cells.shape, values.shape) != shapes or steps_done < 0:
        raise ValueError(f"cells {cells.shape} with values {values.shape}, steps {steps_done}")
    if (cells.dtype, values.dtype) != (np.int32, np.float32):
        raise ValueError(f"cells {cells.dtype} with values {values.dtype}")
    if len(cells) and not ((cells >= box.lower) & (cells < box.upper)).all():
        raise ValueError(f"cells beyond {box}")
    outside = np.zeros((1, values.shape[1]), dtype=np.float32)
    values = np.concatenate([values, outside])
    return RollState(cells, values, steps_done, None if frame is None else int(frame))


def _carried_tensors(carried: Carried | None) -> dict[str, Any]:
    if carried is None:
        return {}
    values = {_CARRIED + name: value for name, value in carried.values.items()}
    return {_CARRIED_CELLS: np.ascontiguousarray(carried.cells), **values}


def _carried(tensors: Mapping[str, Any]) -> Carried | None:
    """What `_carried_tensors` was given, after a look as `_state` has.

    Raises:
        ValueError: If it does not fit together.
    """
    cells = tensors.get(_CARRIED_CELLS)
    if cells is None:
        return None
    values = {
        name.removeprefix(_CARRIED): value
        for name, value in tensors.items()
        if name.startswith(_CARRIED) and name != _CARRIED_CELLS
    }
    kinds = {(value.shape, value.dtype) for value in values.values()}
    if (cells.dtype, cells.shape[1:]) != (np.int32, (3,)) or kinds != {
        ((len(cells),), np.dtype(np.float32))
    }:
        raise ValueError(f"carried: cells {cells.shape} {cells.dtype} with values {kinds}")
    return Carried(cells, values)
