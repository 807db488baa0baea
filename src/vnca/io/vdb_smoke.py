"""Smoke in OpenVDB files: which grids it is, and whether they fit together."""

import math
from pathlib import Path

import numpy as np

from vnca.errors import FileFormatError, GridError
from vnca.io.smoke_format import (
    CELLS_PER_FRAME,
    NOT_WANTED,
    UNITS_METADATA,
    Extent,
    SmokeFormat,
    StoredSmoke,
    StoredVelocity,
    single_precision,
    upper_grown,
)
from vnca.io.vdb import EMPTY_BOX, Grid, GridHeader, Transform, VdbFile, open_vdb
from vnca.io.vdb_grids import components, listed_vectors, velocity_headers
from vnca.io.vdb_velocity import resampled_velocity
from vnca.typing import BoolArray, Box, FloatArray

_CELL_TOLERANCE = 1e-3
# A small file may want arrays of 512³ cells, one of 500 KB the most there are (2³¹).
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
        if not file.grids:
            return StoredSmoke(np.zeros((0, 0, 0), np.float32), (0, 0, 0), np.eye(4), None)
        header, density, box = read_density(file, format)
        values, active = density.to_dense(box, fill=0)
        del density, active
        return StoredSmoke(
            single_precision(values, path, f"grid {header.name!r}"),
            box.lower,
            header.transform.index_to_world,
            _read_velocity(file, format, box, header.transform),
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
    return f"choose with --velocity-grid from {vectors} ({NOT_WANTED})"


def density_header(file: VdbFile, format: SmokeFormat) -> GridHeader:
    """The grid that holds the density.

    Raises:
        GridError: If it is missing, holds vectors, or is a level set.
    """
    name = format.density_grid
    if name not in file.names:
        raise GridError(
            f"{file.path}: no density grid {name!r}; "
            f"choose with --density-grid from {file.listed()}"
        )
    header = file.grids[name]
    label = f"{file.path}: density grid {name!r}"
    if components(header) == 3:
        raise GridError(f"{label} holds vectors, expected numbers; choose with --density-grid")
    if header.grid_class == "level set":
        raise GridError(f"{label} is a level set, expected a fog volume; convert it first")
    return header


def read_density(file: VdbFile, format: SmokeFormat) -> tuple[GridHeader, Grid, Box]:
    """The density grid, and the smallest box around its active cells.

    Raises:
        FileFormatError: If it is truncated or corrupt.
        GridError: If it is missing, of the wrong kind, or too sparse to be put into an array.
    """
    header = density_header(file, format)
    label = f"{file.path}: grid {header.name!r}"
    grid = header.read()
    box = grid.active_box()
    if header.box is not None and header.box.union(box) != header.box:
        raise FileFormatError(f"{label} has active cells outside the box its metadata gives")
    if math.prod(box.shape) > max(MOST_CELLS, header.stored_bytes * MOST_CELLS_A_BYTE):
        raise GridError(
            f"{label}: {grid.active_voxels} active cells are scattered over {_extent(box)}, too "
            "many to hold; remove those that stray, or resample the grid"
        )
    return header, grid, box


def _read_velocity(
    file: VdbFile, format: SmokeFormat, box: Box, density: Transform
) -> StoredVelocity | None:
    headers = velocity_headers(file, format)
    if not headers and file.unfound and format.velocity_grid is None:
        raise GridError(
            f"{file.path}: no velocity among {file.listed()}; write the file again with offsets, "
            "or leave the velocity out with --velocity-grid none"
        )
    if not headers:
        return None
    for header in headers:
        if header.linear_transform is None:
            raise GridError(
                f"{file.path}: velocity grid {header.name!r} has a {header.map_type}, and only "
                "linear transforms are supported; leave it out with --velocity-grid none"
            )
    # A vector grid has one transform for all components, a scalar one its own.
    axes = (None,) if len(headers) == 1 else (0, 1, 2)
    faces = [_is_on_faces(h, axis, format, density) for h, axis in zip(headers, axes, strict=True)]
    told = len(headers) == 1 and headers[0].metadata.value(UNITS_METADATA) == CELLS_PER_FRAME
    if None in faces:
        return resampled_velocity(headers, format, box, density, told=told)
    x, *others = map(bool, faces)
    y, z = others or (x, x)
    parts = [_dense(header, box) for header in headers]
    if len(headers) == 1:
        return StoredVelocity(*parts[0], (x, y, z), told)
    values = np.stack([part for part, _ in parts], axis=-1)
    # A component that is zero everywhere may not be stored at all.
    stored = np.logical_or.reduce([active for _, active in parts])
    return StoredVelocity(values, stored, (x, y, z))


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


def _dense(header: GridHeader, box: Box) -> tuple[FloatArray, BoolArray]:
    """Values over `box` with one layer more at upper ends, zero where inactive, and what is active.

    Raises:
        GridError: If the grid holds cells, but none of those.
    """
    grid, whole = header.read(), upper_grown(box)
    there = grid.active_box()
    if not there.is_empty and not box.is_empty and there.intersection(whole).is_empty:
        raise GridError(
            f"{header.source.path}: velocity grid {header.name!r} covers {_extent(there)}, the "
            f"density {_extent(box)}: they do not meet; leave the velocity out with "
            "--velocity-grid none"
        )
    values, active = grid.to_dense(whole, fill=0)
    return single_precision(values, header.source.path, f"grid {header.name!r}"), active


def _extent(box: Box) -> str:
    return f"cells {box.lower} to {box.upper}"
