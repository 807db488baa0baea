"""How far the painting of a sequence has come, in a small file beside it: data, never code."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from safetensors import SafetensorError, safe_open

from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file, whole_file
from vnca.core.streamed import Streamed, write_tensors
from vnca.direction import Carried
from vnca.painting import Roll
from vnca.painting.state import RollState

_METADATA = "vnca"
_LONGEST_VALUE = 40
_ANEW, _OTHER_STATE = "start anew without `resume`", "name another as `state_in`"
_CELLS_AT_ONCE = 1 << 20
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
class StoredState:
    """A state in such a file, looked at for what a damaged one could do harm with.

    Attributes:
        cells: `[n, 3]` and
        values: `[n, C]`, slices of the file.
        steps_done: As of `RollState`.
        frame: As of `RollState`.
        roll: Its rule.
    """

    cells: Any
    values: Any
    steps_done: int
    frame: int | None
    roll: Roll

    def __post_init__(self) -> None:
        found = [tuple(each.get_shape()) for each in (self.cells, self.values)]
        kinds = [each.get_dtype() for each in (self.cells, self.values)]
        count = found[0][:1]
        if found != [(*count, 3), (*count, self.roll.rule.config.channels)] or self.steps_done < 0:
            raise ValueError(f"cells {found[0]} with values {found[1]}, steps {self.steps_done}")
        if kinds != ["I32", "F32"]:
            raise ValueError(f"cells {kinds[0]} with values {kinds[1]}")

    def pieces(self) -> Iterator[tuple[Any, Any]]:
        """Cells and their values, some at a time.

        Raises:
            ValueError: If there are cells beyond the box of the sequence.
        """
        box = self.roll.reached
        count = self.cells.get_shape()[0]
        for start in range(0, count, _CELLS_AT_ONCE):
            some = slice(start, min(start + _CELLS_AT_ONCE, count))
            cells, values = self.cells[some], self.values[some]
            if not ((cells >= box.lower) & (cells < box.upper)).all():
                raise ValueError(f"cells beyond {box}")
            yield cells, values

    def whole(self) -> RollState:
        """All of it."""
        empty = RollState.empty(self.roll.rule.config.channels, self.steps_done)
        cells, values = zip((empty.cells, empty.values[:0]), *self.pieces(), strict=True)
        with_outside = np.concatenate([*values, empty.values])
        return RollState(np.concatenate(cells), with_outside, self.steps_done, self.frame)


@dataclass(frozen=True, eq=False)
class Unfinished:
    """A painting as its last finished frame left it.

    Attributes:
        conditions: What must be the same to go on, by the name a user knows it by; JSON values.
        sources: Of each finished frame, from the first; None for one that was left out.
        state: What the next frame goes on from: a `RollState`, or a `TiledState`.
    """

    conditions: Mapping[str, Any]
    sources: tuple[Source | None, ...]
    state: Any

    def save(self, path: Path) -> None:
        """Write it, whole or not at all; a piece of the state at a time.

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
        tensors = {
            name: Streamed(value.dtype, value.shape, iter([value]))
            for name, value in _carried_tensors(self.state.carried).items()
        }
        for number, state in enumerate(states):
            tensors[_CELLS.format(number)] = Streamed(
                np.dtype(np.int32), (len(state), 3), (cells for cells, _ in state.pieces())
            )
            tensors[_VALUES.format(number)] = Streamed(
                np.dtype(np.float32),
                (len(state), state.channels),
                (values for _, values in state.pieces()),
            )
        with whole_file(path) as temporary, temporary.open("wb") as file:
            write_tensors(file, tensors, {_METADATA: json.dumps(described)})

    @classmethod
    def load(
        cls,
        path: Path,
        conditions: Mapping[str, Any],
        roll: Roll,
        taken: "Callable[[StoredState], Any] | None" = None,
        *,
        handed_over: bool = False,
    ) -> "Unfinished":
        """Read it, if it can be gone on from under these conditions.

        Args:
            path: The file.
            conditions: What has to be the same.
            roll: What goes on.
            taken: What becomes of the state of it and of each layer; it is read whole unless given.
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
                    (taken or StoredState.whole)(
                        StoredState(
                            file.get_slice(_CELLS.format(number)),
                            file.get_slice(_VALUES.format(number)),
                            int(done),
                            None if frame is None else int(frame),
                            each,
                        )
                    )
                    for number, (each, done, frame) in enumerate(
                        zip(rolls, steps, described["frames"], strict=True)
                    )
                )
                names = [name for name in file.keys() if name.startswith(_CARRIED)]  # noqa: SIM118
                carried = _carried({name: file.get_tensor(name) for name in names})
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
