"""Frames of smoke of which parts are read, as painting them needs them.

A part is the frame as `read_smoke` gives it, but smoke is only where it was asked for: all that is
told of the frame as a whole, as its box, is the same, and so is every value in the part.
"""

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.bricks import CELLS, covered, meeting
from vnca.core.errors import FileFormatError, GridError
from vnca.core.field import Field
from vnca.core.lattice import Lattice, Placement
from vnca.core.volume import Volume
from vnca.io import (
    EXTRAPOLATED_CELLS,
    SmokeFormat,
    density_range,
    made_ours,
    read_smoke,
    require_density,
    smoke_extent,
)
from vnca.io.smoke_format import NO_VELOCITY, up_axis_of, upright_world
from vnca.io.vdb import Grid, GridHeader, GridIndex, VdbFile, open_vdb
from vnca.io.vdb_smoke import density_header, smoke_in, velocity_faces
from vnca.io.vdb_velocity import velocity_headers

_VELOCITY_REACH = EXTRAPOLATED_CELLS + 2
"""Cells from which velocity comes to a cell: continued, and from the next face."""
_BESIDE = 16
"""Cells in which the bricks beside one lie."""


class SmokeParts(ABC):
    """A frame of which parts can be had.

    Attributes:
        box: Its cells, in the lattice.
        frame: Its number.
    """

    box: Box
    frame: int

    @abstractmethod
    def holds(self, box: Box) -> bool:
        """Whether there may be smoke in a box."""

    @abstractmethod
    def count(self, box: Box) -> float:
        """About how many cells of smoke there are in a box."""

    @abstractmethod
    def part(self, box: Box, *, motion: bool = True) -> Volume:
        """The frame with the smoke in a box, and whatever there is elsewhere.

        Args:
            box: Cells of the lattice.
            motion: Whether its velocity is wanted.

        Raises:
            FileFormatError: If the file is corrupt there.
            GridError: If values there are no smoke.
        """

    @property
    @abstractmethod
    def seen(self) -> tuple[float, float]:
        """The least and the greatest density of the parts so far, as `density_range` has them."""

    @abstractmethod
    def require(self, seen: tuple[float, float]) -> None:
        """Refuse a frame that is no smoke.

        Args:
            seen: The least and the greatest density of its parts, whoever took them.

        Raises:
            GridError: If it is none.
        """


@dataclass(frozen=True, eq=False)
class WholeSmoke(SmokeParts):
    """A frame in memory.

    Attributes:
        smoke: The frame.
    """

    smoke: Volume

    @property
    def box(self) -> Box:  # type: ignore[override]
        """See `SmokeParts`."""
        return self.smoke.box

    @property
    def frame(self) -> int:  # type: ignore[override]
        """See `SmokeParts`."""
        return self.smoke.frame

    def holds(self, box: Box) -> bool:
        """See `SmokeParts.holds`."""
        return bool(meeting(self.smoke.density_field.bricks, box).any())

    def count(self, box: Box) -> float:
        """See `SmokeParts.count`."""
        density = self.smoke.density_field
        first, last = covered(density.bricks, box)
        share = np.prod(np.maximum(last - first, 0), axis=1) / CELLS
        return float((share * self._counts).sum())

    @cached_property
    def _counts(self) -> AnyArray:
        """`[m]` cells of smoke in each brick."""
        return np.count_nonzero(self.smoke.density_field.values, axis=(1, 2, 3))

    def part(self, box: Box, *, motion: bool = True) -> Volume:
        """See `SmokeParts.part`."""
        smoke = self.smoke
        velocity = smoke.velocity_field if motion else None
        return Volume.of_fields(
            _cut(smoke.density_field, box),
            None if velocity is None else _cut(velocity, box),
            smoke.index_to_world,
            smoke.frame,
            {name: _cut(held, box) for name, held in smoke.named_fields.items()},
        )

    @property
    def seen(self) -> tuple[float, float]:
        """Nothing: it was looked at when it was read."""
        return 0.0, 0.0

    def require(self, seen: tuple[float, float]) -> None:
        """See `seen`."""


def _cut(field: Field, box: Box) -> Field:
    """The bricks of a field that meet a box."""
    kept = meeting(field.bricks, box)
    return replace(field, bricks=field.bricks[kept], values=field.values[kept])


@dataclass(eq=False)
class VdbSmoke(SmokeParts):
    """A frame in a VDB file of which the leaves are read that are wanted.

    Attributes:
        file: The file, open.
        format: How it is read.
        frame: Its number.
        lattice: On whose cells it lies, cell on cell.
        place: From the file's cells to those.
        indices: Of all the grids that are read.
    """

    file: VdbFile
    format: SmokeFormat
    frame: int
    lattice: Lattice
    place: Placement
    indices: Mapping[str, GridIndex]
    _range: tuple[float, float] = field(default=(0.0, 0.0), init=False)
    _one_reader: threading.Lock = field(default_factory=threading.Lock, init=False)

    @property
    def box(self) -> Box:  # type: ignore[override]
        """See `SmokeParts`."""
        return self.place.box(self.density.active_box)

    @property
    def density(self) -> GridIndex:
        """Its density, in the file."""
        return self.indices[self.format.density_grid]

    def holds(self, box: Box) -> bool:
        """See `SmokeParts.holds`."""
        return self.density.holds(self.place.inverse.box(box))

    def count(self, box: Box) -> float:
        """See `SmokeParts.count`."""
        return self.density.count(self.place.inverse.box(box))

    @property
    def seen(self) -> tuple[float, float]:
        """See `SmokeParts.seen`."""
        return self._range

    def part(self, box: Box, *, motion: bool = True) -> Volume:
        """See `SmokeParts.part`; one thread at a time reads from the file."""
        with self._one_reader:
            return self._part(box, motion=motion)

    def _part(self, box: Box, *, motion: bool) -> Volume:
        format = self.format if motion else replace(self.format, velocity_grid=NO_VELOCITY)
        wanted = self.place.inverse.box(box)
        near = wanted.grown(_VELOCITY_REACH)
        if any(index.is_filled for index in self.indices.values()):
            # Where velocity is known only beside smoke, so must that be.
            wanted = near.grown(_BESIDE)

        def read(header: GridHeader) -> Grid:
            return self.indices[header.name].part(
                wanted if header.name == format.density_grid else near
            )

        stored = smoke_in(self.file, format, read)
        (low, high), (least, most) = density_range(stored), self._range
        self._range = min(low, least), max(high, most)
        path = self.file.path
        return made_ours(stored, path, format, frame=self.frame, lattice=self.lattice)

    def require(self, seen: tuple[float, float]) -> None:
        """See `SmokeParts.require`."""
        require_density(seen, self.file.path)


def open_parts(
    path: Path, format: SmokeFormat, *, frame: int, lattice: Lattice, file: VdbFile | None
) -> SmokeParts:
    """A frame of which parts can be read; in memory as a whole where its file has no such parts.

    That is so where its cells, or those of its velocity, are not the lattice's cells, and in other
    files than VDB. Arguments and errors are those of `read_smoke`.
    """
    parts = None if file is None else _in_file(file, format, frame, lattice)
    if parts is None:
        return WholeSmoke(read_smoke(path, format, frame=frame, lattice=lattice, file=file))
    return parts


def _in_file(file: VdbFile, format: SmokeFormat, frame: int, lattice: Lattice) -> VdbSmoke | None:
    if not file.grids:
        return None
    header = density_header(file, format)
    headers = velocity_headers(file, format)
    if None in velocity_faces(headers, format, header.transform):
        return None
    index = header.indexed()
    if index.active_box.is_empty:
        return None
    world = upright_world(header.transform.index_to_world, up_axis_of(file.path, format))
    what = f"{file.path}: grid {header.name!r}"
    place = Placement.between(world, lattice.to_world, index.active_box, what)
    if not place.is_whole:
        return None
    further = (file.grids[name] for name in format.fields if name in file.grids)
    others = (*headers, *further)
    indices = {header.name: index, **{each.name: each.indexed() for each in others}}
    return VdbSmoke(file, format, frame, lattice, place, indices)


def smoke_cells(path: Path, format: SmokeFormat) -> int:
    """How many cells of smoke a frame has as its headers tell; none if it cannot be read."""
    with suppress(FileFormatError, GridError):
        if path.suffix.lower() == ".vdb":
            with open_vdb(path) as file:
                header = density_header(file, format) if file.grids else None
                told = header and header.metadata.value("file_voxel_count")
            if told:
                return int(told)
        return math.prod(smoke_extent(path, format).box.shape)
    return 0
