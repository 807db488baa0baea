"""How many cells a painting has, from the nodes of the files' trees, without their values."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vnca.core.field import Field, dilated
from vnca.core.lattice import Region
from vnca.engine.domain import DomainKind
from vnca.io import SmokeFormat, read_smoke
from vnca.io.sequence import Frame, FrameSequence
from vnca.io.smoke_format import NO_VELOCITY
from vnca.io.vdb import open_vdb
from vnca.io.vdb_smoke import density_header


class Active(NamedTuple):
    """What the nodes of a file's trees tell.

    Attributes:
        cells: Which cells of the density's grid are active.
        volume: Of each in the world.
        copied: Bytes of the other grids.
        half: Whether density is saved as half floats, and so the painting is.
    """

    cells: Field
    volume: float
    copied: int
    half: bool


class Count(NamedTuple):
    """The cells of a frame, on the grid of the smoke.

    Attributes:
        frame: Its number.
        smoke: Active cells of the density's grid: what is painted, at least.
        cells: Cells of the automaton, at most: it leaves out smoke that is too thin.
        copied: Bytes of the file's other grids, which a painted file has, too.
        half: As of `Active`.
    """

    frame: int
    smoke: int
    cells: int
    copied: int
    half: bool = False


def counted(
    sequence: FrameSequence, smoke: SmokeFormat, region: Region, dilation: int, kind: DomainKind
) -> Iterator[Count]:
    """The cells of each frame.

    Args:
        sequence: The frames.
        smoke: How they are read.
        region: The lattice of the sequence, and the box of its smoke.
        dilation: How many cells around smoke are active.
        kind: Which cells are: those near smoke, or all of the box.

    Raises:
        FileFormatError: If a frame cannot be read.
        GridError: If it has no density.
    """
    cell = abs(np.linalg.det(region.lattice.to_world[:3, :3]))
    whole = math.prod(region.box.grown(dilation).shape)
    for frame in sequence:
        active = active_cells(frame, smoke)
        share = active.volume / cell  # cells of the lattice in one of the file
        alive = around(active.cells, dilation)
        count = whole if kind == "box" else round(int(alive.values.sum()) * share)
        held = round(int(active.cells.values.sum()) * share)
        yield Count(frame.number, held, count, active.copied, active.half)


def active_cells(frame: Frame, smoke: SmokeFormat) -> Active:
    """Which cells of a file are active, and what else its headers tell.

    Formats that do not tell apart from their values are read whole.

    Raises:
        FileFormatError: If it cannot be read.
        GridError: If it has no density.
    """
    if frame.path.suffix.lower() != ".vdb":
        volume = read_smoke(frame.path, replace(smoke, velocity_grid=NO_VELOCITY))
        density, matrix = volume.density_field, volume.index_to_world
        active = replace(density, values=density.values > 0, outside=False).trimmed()
        return Active(active, abs(float(np.linalg.det(matrix[:3, :3]))), 0, False)
    with open_vdb(frame.path) as file:
        header = density_header(file, smoke)
        grid = header.read_active()
        active, _ = grid.fields(grid.active_box())
        others = (g for g in file.grids.values() if g.name != header.name and g.parent is None)
        copied = sum(other.stored_bytes for other in others)
        matrix = header.transform.index_to_world
    volume = abs(float(np.linalg.det(matrix[:3, :3])))
    return Active(active.trimmed(), volume, copied, header.is_half)


def around(active: Field, dilation: int) -> Field:
    """Cells at most `dilation` cells along each axis from one that is active."""
    return dilated(replace(active, box=active.box.grown(dilation)), dilation)
