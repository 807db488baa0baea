"""Grids of numbers as values: of the smoke's files, or of others."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import FileFormatError, GridError, SequenceError
from vnca.core.field import Field
from vnca.core.files import existing_file
from vnca.direction.mixing import Answer
from vnca.direction.moment import Inputs, Moment, Paths
from vnca.direction.values import Value
from vnca.io.sequence import find_frames
from vnca.io.smoke_format import single_precision, upright_world
from vnca.io.vdb import GridHeader, open_vdb
from vnca.io.velocity import interpolated

_MOST_PARTS = 4
_VDB = ".vdb"


class Stored(NamedTuple):
    """A grid of numbers or vectors, and where it lies.

    Attributes:
        values: Of its cells.
        known: Which of them have a value.
        background: What holds everywhere else: a number, or `[3]`.
        to_world: 4×4, from its index coordinates to our world.
        is_staggered: Whether components of vectors lie on the lower faces of the cells.
    """

    values: Field
    known: Field
    background: Any
    to_world: AnyArray
    is_staggered: bool = False

    def components(self) -> Iterator["Stored"]:
        """Of a grid of vectors, each as a grid of numbers."""
        background = np.broadcast_to(self.background, 3)
        for axis in range(3):
            matrix = self.to_world.copy()
            matrix[:3, 3] -= 0.5 * self.is_staggered * matrix[:3, axis]
            values = replace(self.values, values=self.values.values[..., axis], outside=0)
            yield Stored(values, self.known, background[axis], matrix)

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """Its values at places of a frame: straight between those cells that have one.

        Where a cell of the smoke holds several of its cells, the mean of several places.
        """
        to_own = np.linalg.inv(self.to_world) @ moment.smoke.index_to_world
        sides = np.linalg.norm(to_own[:3, :3], axis=0)
        # A power of two: then the mean of equals is exact.
        parts = [min(_MOST_PARTS, 2 ** max(0, round(np.log2(side)) - 1)) for side in sides]
        steps = product(*((np.arange(count) + 0.5) / count - 0.5 for count in parts))
        total = np.zeros(len(places))
        for step in steps:
            own = (places + np.array(step)) @ to_own[:3, :3].T + to_own[:3, 3]
            total += self._between(own)
        return (total / np.prod(parts)).astype(np.float32)

    def _between(self, own: AnyArray) -> AnyArray:
        # A cell has a share in what is less than a cell from its centre.
        lower, upper = np.array(self.values.box.lower) - 1, np.array(self.values.box.upper)
        near = ((own > lower) & (own < upper)).all(axis=1)
        found = np.full(len(own), np.float32(self.background))
        if near.any():
            values = replace(self.values, values=self.values.values[..., None])
            inside, is_known = interpolated(values, self.known, own[near])
            found[near] = np.where(is_known, inside[:, 0], np.float32(self.background))
        return found


@dataclass(frozen=True)
class Grid(Value):
    """A grid of numbers that the frame has, or its file."""

    name: str

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        stored = _of_frame(moment, self.name, vectors=False) if len(places) else None
        return 0.0 if stored is None else stored.at(moment, places)

    def require(self, inputs: Inputs) -> None:
        """Refuse a grid that frames lack, as their headers tell.

        Raises:
            GridError: If a frame lacks it, or all do; or it holds no numbers.
            FileFormatError: If a file cannot be read.
        """
        require_grid(inputs, inputs.paths, self.name)


def stored_vectors(moment: Moment, name: str) -> list[Stored] | None:
    """The three components of a grid of vectors of a frame; None where it is not, and zero holds.

    Raises:
        GridError: If there is none, and something has to be; or it holds numbers.
    """
    stored = _of_frame(moment, name, vectors=True)
    return None if stored is None else [*stored.components()]


def _of_frame(moment: Moment, name: str, *, vectors: bool) -> Stored | None:
    """A grid that a frame has, or its file."""
    smoke = moment.smoke
    if name in smoke.named_fields:
        held = smoke.named_fields[name]
        known = replace(held, values=held.values != 0, outside=False)
        if held.values.ndim > 4:
            known = replace(known, values=known.values.any(axis=-1))
        stored = Stored(held, known.union(moment.is_smoke), 0.0, smoke.index_to_world)
    else:
        stored = _stored(moment.inputs, moment.frame, moment.inputs.paths, name)
    if stored is not None and (stored.values.values.ndim > 4) is not vectors:
        held, wanted = ("numbers", "vectors") if vectors else ("vectors", "numbers")
        raise GridError(f"frame {smoke.frame}: @{name} holds {held}, expected {wanted}")
    return stored


@dataclass(frozen=True)
class FileGrid(Value):
    """A grid of numbers of another VDB file, still, or of those of a sequence, frame by frame."""

    path: str
    name: str = ""

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        if not len(places):
            return 0.0
        stored = _stored(moment.inputs, moment.frame, self._paths(moment.inputs), self.name)
        return 0.0 if stored is None else stored.at(moment, places)

    def require(self, inputs: Inputs) -> None:
        """See `Grid.require`.

        Raises:
            SequenceError: If there is no such file.
        """
        paths = self._paths(inputs)
        if None not in paths and inputs.missing == "stop":
            lacking = [number for number in inputs.paths if number not in paths]
            if lacking:
                raise SequenceError(
                    f"{self.path}: no file for frame {lacking[0]}; choose `missing` zero or hold"
                )
        require_grid(inputs, paths, self.name)

    def files(self, inputs: Inputs) -> Iterator[Path]:
        """What it reads."""
        yield from self._paths(inputs).values()

    def _paths(self, inputs: Inputs) -> Paths:
        """The file of each frame, by its number; one for all under None."""
        if self not in inputs.kept:
            path = Path(self.path)
            if path.suffix.lower() == _VDB and path.is_file():
                inputs.kept[self] = {None: path}
            else:
                frames = find_frames(self.path)
                inputs.kept[self] = {frame.number: frame.path for frame in frames}
        return inputs.kept[self]


def _stored(inputs: Inputs, frame: int, paths: Paths, name: str) -> Stored | None:
    """A grid as a frame has it; None where there is none, and zero holds.

    Raises:
        GridError: If there is none, and something has to be.
    """
    path = paths.get(None if None in paths else frame)
    stored = None if path is None else _read(inputs, path, name)
    if stored is None and inputs.missing == "hold":
        earlier = sorted((n for n in paths if n is not None and n < frame), reverse=True)
        found = (_read(inputs, paths[number], name) for number in earlier)
        return next((each for each in found if each is not None), None)
    if stored is None and inputs.missing == "stop":
        where = f"frame {frame}" if path is None else str(path)
        raise GridError(
            f"{where}: no grid {name!r}, or one without values; choose `missing` zero or hold"
        )
    return stored


def _read(inputs: Inputs, path: Path, name: str) -> Stored | None:
    """A grid of a file, kept until another is asked for; None if it is not there or empty."""
    key = path, name
    slot = "grid", path.parent, name
    if inputs.kept.get(slot, (None,))[0] != key:
        inputs.kept[slot] = key, _read_now(inputs, path, name)
    return inputs.kept[slot][1]


def _read_now(inputs: Inputs, path: Path, name: str) -> Stored | None:
    if existing_file(path).suffix.lower() != _VDB:
        return None
    with open_vdb(path) as file:
        header = _header(file.grids, name)
        if header is None:
            return None
        grid = header.read()
        box = grid.active_box()
        if box.is_empty:
            return None
        values, known = grid.fields(box)
        matrix = upright_world(header.transform.index_to_world, inputs.up)
        background = np.asarray(grid.tree.background, np.float64)
        is_staggered = header.grid_class == "staggered"
    found = single_precision(values.values, path, f"grid {header.name!r}", stored=known.values)
    background = np.where(np.isfinite(background), background, 0)
    return Stored(replace(values, values=found), known, background, matrix, is_staggered)


def _header(named: Mapping[str, GridHeader], name: str) -> GridHeader | None:
    """The grid of a name; of none, the first of numbers."""
    if name:
        return named.get(name)
    return next((h for h in named.values() if not h.value_type.startswith("vec")), None)


def require_grid(inputs: Inputs, paths: Paths, name: str, *, vectors: bool = False) -> None:
    """Refuse a grid of numbers, or of vectors, that frames lack, as their headers tell.

    Raises:
        GridError: If a frame lacks it, or all do; or it is of the other kind.
        FileFormatError: If a file cannot be read.
    """
    lacking = [path for path in paths.values() if not _has(path, name, vectors)]
    if lacking and inputs.missing == "stop":
        raise GridError(
            f"{lacking[0]}: no grid {name!r}{_among(lacking[0])}, or one without values; name a "
            "mask with `masks`, or choose `missing` zero or hold"
        )
    if lacking and len(lacking) == len(paths):
        raise GridError(f"{lacking[0]}: no grid {name!r} with values, in this or any other frame")


def _among(path: Path) -> str:
    """What a file has instead."""
    if path.suffix.lower() != _VDB:
        return ""
    with open_vdb(path) as file:
        return f" among {file.listed()}"


def _has(path: Path, name: str, vectors: bool) -> bool:
    """Whether a file has values of a grid, by its headers; what is broken painting tells."""
    if path.suffix.lower() != _VDB:
        return False
    with suppress(FileFormatError), open_vdb(path) as file:
        header = _header(file.grids, name)
        if header is None:
            return not file.grids  # a frame without smoke
        if header.value_type.startswith("vec") is not vectors:
            held, wanted = ("numbers", "vectors") if vectors else ("vectors", "numbers")
            raise GridError(f"{path}: grid {header.name!r} holds {held}, expected {wanted}")
        return header.box is None or not header.box.is_empty
    return True
