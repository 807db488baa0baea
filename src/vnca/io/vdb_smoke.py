"""Smoke in OpenVDB files: which grids it is, and whether they fit together."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vnca.core import Box, IntArray
from vnca.core.bricks import bricks_beside, sorted_bricks
from vnca.core.errors import FileFormatError, GridError
from vnca.core.field import Field
from vnca.io.smoke_format import (
    CELLS_PER_FRAME,
    NOT_WANTED,
    UNITS_METADATA,
    Extent,
    Reader,
    SmokeFormat,
    StoredSmoke,
    StoredVelocity,
    single_precision,
    upper_grown,
)
from vnca.io.vdb import EMPTY_BOX, Grid, GridHeader, Transform, VdbFile, open_vdb
from vnca.io.vdb_velocity import components, listed_vectors, resampled_velocity, velocity_headers

_CELL_TOLERANCE = 1e-3
# A small file may hold 512³ cells, in tiles or packed well, one of 500 KB 2³¹.
MOST_CELLS, MOST_CELLS_A_BYTE = 2**27, 2**12


def read_vdb_smoke(path: Path, format: SmokeFormat) -> StoredSmoke:
    """Density over the box of its active cells, and velocity where the file has it.

    Inactive cells are empty, whatever value they store. A file without grids is a frame without
    smoke, in a place of which nothing is known.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If grids are missing, of the wrong kind, or do not fit together.
    """
    with open_vdb(path) as file:
        return smoke_in(file, format)


def smoke_in(
    file: VdbFile, format: SmokeFormat, read: Callable[[GridHeader], Grid] = GridHeader.read
) -> StoredSmoke:
    """As `read_vdb_smoke`, of a file that is open; or of parts of its grids, if `read` gives those.

    A velocity on other cells than the density's is always read as a whole.
    """
    if not file.grids:
        nothing = Field.from_dense(np.zeros((0, 0, 0), np.float32), (0, 0, 0))
        return StoredSmoke(nothing, np.eye(4), None)
    header, grid, box = read_density(file, format, read)
    density, _ = _finite(header, grid, box)
    return StoredSmoke(
        density,
        header.transform.index_to_world,
        _read_velocity(file, format, density, header.transform, read),
        {name: _read_field(file, name, density, header.transform, read) for name in format.fields},
    )


def vdb_smoke_extent(path: Path, format: SmokeFormat) -> Extent:
    """Where the density's active cells lie, from the header where it tells.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If there are grids, but no density grid.
    """
    with open_vdb(path) as file:
        if not file.grids:
            return Extent(EMPTY_BOX, np.eye(4))
        header = density_header(file, format)
        box = header.read().active_box() if header.box is None else header.box
        return Extent(box, header.transform.index_to_world)


def where_vdb_velocity_is(path: Path) -> str:
    """What to tell whoever expected velocity in a file that has none under a known name.

    Raises:
        FileFormatError: If the file cannot be read.
    """
    with open_vdb(path) as file:
        vectors = listed_vectors(file)
    if not vectors:
        return f"no other grid of vectors either ({NOT_WANTED})"
    return f"choose with `velocity_grid` from {vectors} ({NOT_WANTED})"


def density_header(file: VdbFile, format: SmokeFormat) -> GridHeader:
    """The grid that holds the density.

    Raises:
        GridError: If it is missing, holds vectors, or is a level set.
    """
    name = format.density_grid
    if name not in file.names:
        fit = [each.name for each in file.grids.values() if _can_be_density(each)]
        raise GridError(
            f"{file.path}: no density grid {name!r}; "
            + (
                f"choose with `density_grid` from {file.listed(fit)}"
                if fit
                else f"there is {file.listed()}, and no other grid of numbers that could be it"
            )
        )
    header = file.grids[name]
    label = f"{file.path}: density grid {name!r}"
    if components(header) == 3:
        raise GridError(f"{label} holds vectors, expected numbers; choose with `density_grid`")
    if not _can_be_density(header):
        raise GridError(f"{label} is a level set, expected a fog volume; convert it first")
    return header


def _can_be_density(header: GridHeader) -> bool:
    return components(header) == 1 and header.grid_class != "level set"


def read_density(
    file: VdbFile, format: SmokeFormat, read: Callable[[GridHeader], Grid] = GridHeader.read
) -> tuple[GridHeader, Grid, Box]:
    """The density grid, and the smallest box around its active cells; `read` gives it, or a part.

    Raises:
        FileFormatError: If it is truncated or corrupt.
        GridError: If it is missing, of the wrong kind, or has more active cells than fit.
    """
    header = density_header(file, format)
    label = f"{file.path}: grid {header.name!r}"
    grid = read(header)
    box = grid.active_box()
    if header.box is not None and header.box.union(box) != header.box:
        raise FileFormatError(f"{label} has active cells outside the box its metadata gives")
    if grid.held_cells > max(MOST_CELLS, header.stored_bytes * MOST_CELLS_A_BYTE):
        raise GridError(
            f"{label}: {grid.active_voxels} active cells in {_extent(box)} are too many to hold; "
            "make inactive what is no smoke, or resample the grid"
        )
    return header, grid, box


def _read_field(
    file: VdbFile, name: str, density: Field, place: Transform, read: Callable[[GridHeader], Grid]
) -> Field:
    """A further grid of numbers at the cells of the density, zero where it is inactive.

    Raises:
        GridError: If it is missing, holds no numbers, or has other cells.
    """
    if name not in file.names:
        raise GridError(f"{file.path}: no grid {name!r}; choose `fields` from {file.listed()}")
    header = file.grids[name]
    label = f"{file.path}: grid {name!r}"
    if components(header) != 1:
        raise GridError(f"{label} holds {header.value_type}, expected numbers; see `fields`")
    ours, theirs = (each.index_to_world for each in (place, header.transform))
    if not np.allclose(np.linalg.solve(ours, theirs), np.eye(4), atol=_CELL_TOLERANCE):
        raise GridError(
            f"{label} has other cells than the density; resample it onto those, or leave it out of "
            "`fields`"
        )
    return _finite(header, read(header), density.box, near=density.bricks)[0]


def _read_velocity(
    file: VdbFile,
    format: SmokeFormat,
    density: Field,
    place: Transform,
    read: Callable[[GridHeader], Grid],
) -> StoredVelocity | None:
    headers = velocity_headers(file, format)
    if not headers and file.unfound and format.velocity_grid is None:
        raise GridError(
            f"{file.path}: no velocity among {file.listed()}; write the file again with offsets, "
            "or leave the velocity out with `velocity_grid` none"
        )
    if not headers:
        return None
    faces = velocity_faces(headers, format, place)
    told = len(headers) == 1 and headers[0].metadata.value(UNITS_METADATA) == CELLS_PER_FRAME
    if None in faces:
        return resampled_velocity(headers, format, density, place, told=told)
    x, *others = map(bool, faces)
    y, z = others or (x, x)
    parts = [_around(header, density, read) for header in headers]
    if len(headers) == 1:
        return StoredVelocity(*parts[0], (x, y, z), told)
    whole = parts[0][0].box
    bricks = sorted_bricks(np.concatenate([active.bricks for _, active in parts]))
    values = np.stack([part.blocks(bricks) for part, _ in parts], axis=-1)
    # A component that is zero everywhere may not be stored at all.
    stored = np.logical_or.reduce([active.blocks(bricks) for _, active in parts])
    return StoredVelocity(
        Field(bricks, values, whole), Field(bricks, stored, whole, outside=False), (x, y, z)
    )


def velocity_faces(
    headers: Sequence[GridHeader], format: SmokeFormat, place: Transform
) -> list[bool | None]:
    """Which grids of a velocity lie on lower faces; None for one of other cells than the density's.

    Args:
        headers: One grid of vectors, or those of the components x, y and z.
        format: Whether velocity is staggered, unless the grids are to say.
        place: Where the density's cells lie.
    """
    # A vector grid has one transform for all components, a scalar one its own.
    axes = (0, 1, 2) if len(headers) == 3 else (None,) * len(headers)
    return [_is_on_faces(h, axis, format, place) for h, axis in zip(headers, axes, strict=True)]


def _is_on_faces(
    header: GridHeader, axis: int | None, format: SmokeFormat, density: Transform
) -> bool | None:
    """Whether velocity lies on lower faces; the grid of component `axis` may say so by its place.

    None if its cells are others than the density's.
    """
    to_ours = np.linalg.inv(density.index_to_world) @ header.transform.index_to_world
    shift = to_ours[:3, 3]
    lower_face = np.zeros(3) if axis is None else -0.5 * np.eye(3)[axis]
    is_same = np.allclose(to_ours[:3, :3], np.eye(3), atol=_CELL_TOLERANCE)
    is_shifted = axis is not None and np.allclose(shift, lower_face, atol=_CELL_TOLERANCE)
    if not is_same or not (is_shifted or np.allclose(shift, 0, atol=_CELL_TOLERANCE)):
        return None
    if format.staggered is not None:
        return format.staggered
    return is_shifted or header.grid_class == "staggered"


def _around(
    header: GridHeader, density: Field, read: Callable[[GridHeader], Grid]
) -> tuple[Field, Field]:
    """Values with one layer more than the density at upper ends, and which cells are active.

    Raises:
        GridError: If the grid holds cells, but none of those.
    """
    grid, box = read(header), density.box
    whole, there = upper_grown(box), grid.active_box()
    if not there.is_empty and not box.is_empty and there.intersection(whole).is_empty:
        raise GridError(
            f"{header.source.path}: velocity grid {header.name!r} covers {_extent(there)}, the "
            f"density {_extent(box)}: they do not meet; leave the velocity out with "
            "`velocity_grid` none"
        )
    return _finite(header, grid, whole, near=bricks_beside(density.bricks))


def _finite(
    header: GridHeader, grid: Grid, box: Box, *, near: IntArray | None = None
) -> tuple[Field, Field]:
    """Values of a grid in a box, zero where inactive, and which cells are active.

    Raises:
        GridError: If one is NaN or infinite, or too large for float32.
    """
    values, active = grid.fields(box, near=near)
    what = f"grid {header.name!r}"
    found = single_precision(values.values, header.source.path, what, stored=active.values)
    return replace(values, values=found), active


def _extent(box: Box) -> str:
    return f"cells {box.lower} to {box.upper}"


READER = Reader(read_vdb_smoke, vdb_smoke_extent, where_vdb_velocity_is, up_axis="z")
