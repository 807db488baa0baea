"""Smoke in OpenVDB files: which grids it is, and whether they fit together."""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vnca.errors import FileFormatError, GridError
from vnca.io.smoke_format import (
    CELLS_PER_FRAME,
    NO_VELOCITY,
    UNITS_METADATA,
    Extent,
    SmokeFormat,
    StoredSmoke,
    StoredVelocity,
    single_precision,
    upper_grown,
)
from vnca.io.vdb import VALUE_TYPES, Grid, GridHeader, Transform, VdbFile, open_vdb
from vnca.typing import BoolArray, Box, FloatArray

VELOCITY_NAMES = ("velocity", "vel", "v")
_AXES = "xyz"
_CELL_TOLERANCE = 1e-3
# A small file may want arrays of 512³ cells, one of 500 KB the most there are (2³¹).
MOST_CELLS, MOST_CELLS_A_BYTE = 2**27, 2**12


def read_vdb_smoke(path: Path, format: SmokeFormat) -> StoredSmoke:
    """Density over the box of its active cells, and velocity where the file has it.

    Inactive cells are empty, whatever value they store.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If grids are missing, of the wrong kind, or do not fit together.
    """
    with open_vdb(path) as file:
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
        GridError: If there is no density grid.
    """
    with open_vdb(path) as file:
        header = density_header(file, format)
        box = header.read().active_box() if header.box is None else header.box
        return Extent(box, header.transform.index_to_world)


def density_header(file: VdbFile, format: SmokeFormat) -> GridHeader:
    """The grid that holds the density.

    Raises:
        GridError: If it is missing, holds vectors, or is a level set.
    """
    name = format.density_grid
    if name not in file.names:
        raise GridError(
            f"{file.path}: no density grid {name!r}; "
            f"choose with --density-grid from {_listed(file)}"
        )
    header = file.grids[name]
    label = f"{file.path}: density grid {name!r}"
    if _components(header) == 3:
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
    headers = _velocity_headers(file, format)
    if not headers:
        return None
    # A vector grid has one transform for all components, a scalar one its own.
    axes = (None,) if len(headers) == 1 else (0, 1, 2)
    faces = [_is_on_faces(h, axis, format, density) for h, axis in zip(headers, axes, strict=True)]
    parts = [_dense(header, box) for header in headers]
    if len(headers) == 1:
        told = headers[0].metadata.value(UNITS_METADATA) == CELLS_PER_FRAME
        return StoredVelocity(*parts[0], (faces[0], faces[0], faces[0]), told)
    values = np.stack([part for part, _ in parts], axis=-1)
    # A component that is zero everywhere may not be stored at all.
    stored = np.logical_or.reduce([active for _, active in parts])
    return StoredVelocity(values, stored, (faces[0], faces[1], faces[2]))


def _velocity_headers(file: VdbFile, format: SmokeFormat) -> list[GridHeader]:
    """One vector grid, or three scalar grids in the order x, y, z, or none."""
    if format.velocity_grid == NO_VELOCITY:
        return []
    for name in VELOCITY_NAMES if format.velocity_grid is None else (format.velocity_grid,):
        if name in file.names and _components(file.grids[name]) == 3:
            return [file.grids[name]]
        parts = [f"{name}.{axis}" for axis in _AXES]
        there = [part in file.names and _components(file.grids[part]) == 1 for part in parts]
        if all(there):
            return [file.grids[part] for part in parts]
        if any(there):
            missing = ", ".join(
                part for part, is_there in zip(parts, there, strict=True) if not is_there
            )
            raise GridError(
                f"{file.path}: velocity {name!r} lacks the scalar grid {missing}; "
                "leave the velocity out with --velocity-grid none"
            )
    if format.velocity_grid is None:
        return []
    raise GridError(
        f"{file.path}: no velocity {format.velocity_grid!r}; choose with --velocity-grid none or "
        f"a grid of vectors from {_listed(file)}"
    )


def _is_on_faces(
    header: GridHeader, axis: int | None, format: SmokeFormat, density: Transform
) -> bool:
    """Whether velocity lies on lower faces; the grid of component `axis` may say so by its place.

    Raises:
        GridError: If the grid lies elsewhere than the density.
    """
    ours, theirs = density.index_to_world, header.transform.index_to_world
    to_cells = np.linalg.inv(ours[:3, :3])
    shift = to_cells @ (theirs[:3, 3] - ours[:3, 3])
    lower_face = np.zeros(3) if axis is None else -0.5 * np.eye(3)[axis]
    is_same = np.allclose(to_cells @ theirs[:3, :3], np.eye(3), atol=_CELL_TOLERANCE)
    is_shifted = axis is not None and np.allclose(shift, lower_face, atol=_CELL_TOLERANCE)
    if not is_same or not (is_shifted or np.allclose(shift, 0, atol=_CELL_TOLERANCE)):
        raise GridError(
            f"{header.source.path}: velocity grid {header.name!r} has another transform than the "
            f"density: voxel size {_numbers(header.transform.voxel_size)} against "
            f"{_numbers(density.voxel_size)}, shifted by {_numbers(shift)} cells; resample it"
        )
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
            f"density {_extent(box)}: they do not meet"
        )
    values, active = grid.to_dense(whole, fill=0)
    return single_precision(values, header.source.path, f"grid {header.name!r}"), active


def _components(header: GridHeader) -> int | None:
    value_type = VALUE_TYPES.get(header.value_type)
    return value_type.components if value_type else None


def _listed(file: VdbFile) -> str:
    """The grids of a file with their types."""
    grids = (f"{name} ({header.value_type})" for name, header in file.grids.items())
    return ", ".join(grids) or "no grid at all"


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _extent(box: Box) -> str:
    return f"cells {box.lower} to {box.upper}"
