"""Smoke in and out: a frame's density and velocity, whatever file holds them.

The format is chosen by suffix; `smoke_format.py` has the registry.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.errors import FileFormatError, GridError, OptionError, SequenceError
from vnca.core.field import Field
from vnca.core.files import existing_file
from vnca.core.lattice import Lattice, Placement
from vnca.core.volume import Volume
from vnca.io.painted import write_painted, write_smoke
from vnca.io.sequence import Frame
from vnca.io.smoke_format import (
    Extent,
    Reader,
    SmokeFormat,
    StoredSmoke,
    StoredVelocity,
    on_lattice,
    own_cells,
    reader_of,
    up_axis_of,
    upright_world,
)
from vnca.io.vdb import VdbFile, open_vdb
from vnca.io.vdb_smoke import smoke_in
from vnca.io.velocity import cells_per_frame, centred, extrapolated, fit_velocity_scale

__all__ = [
    "SmokeFormat",
    "missing_velocity",
    "open_source",
    "read_smoke",
    "smoke_box",
    "smoke_extent",
    "with_fitted_scale",
    "write_painted",
    "write_smoke",
]

# Velocity is continued this far beyond the cells that store it.
EXTRAPOLATED_CELLS = 4
# Advection of higher order undershoots a little; what is beyond this is no density.
NEGATIVE_TOLERANCE = 0.1
# Cells per frame that leave room in single precision for a lattice of other cells.
FASTEST = 1e20
_FITTED_PAIRS = 3


_ANY = SmokeFormat()


def read_smoke(
    path: str | Path,
    format: SmokeFormat = _ANY,
    *,
    frame: int = 0,
    lattice: Lattice | None = None,
    file: VdbFile | None = None,
) -> Volume:
    """A frame over the box of its smoke, up along +z, velocity in cells per frame.

    Velocity is continued a few cells beyond where it is stored, and zero farther away. Density a
    little below zero is set to zero. A frame without smoke has arrays of no cells.

    Args:
        path: A `.vdb` file, or a `.npz` file in Mantaflow's layout.
        format: How to read it; a scale to be fitted must have been, see `with_fitted_scale`.
        frame: The frame's number.
        lattice: That of its sequence, on whose cells it is wanted. Otherwise it has its own cells,
            counted along the world's axes, which need not be cubic.
        file: The file itself, if it is open already: see `open_source`.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If grids are missing, do not fit together, or hold values that are no smoke; or
            if they can have no place on the lattice.
        OptionError: If an option has no meaning.
    """
    path = Path(path)
    stored = _reader(path).read(path, format) if file is None else smoke_in(file, format)
    require_density(density_range(stored), path)
    return made_ours(stored, path, format, frame=frame, lattice=lattice)


def made_ours(
    stored: StoredSmoke,
    path: Path,
    format: SmokeFormat,
    *,
    frame: int,
    lattice: Lattice | None,
) -> Volume:
    """Smoke as a file has it, as `read_smoke` gives it; of the density nothing is required.

    Arguments and errors are those of `read_smoke`.
    """
    density = replace(stored.density, values=np.maximum(stored.density.values, 0))
    velocity = None if stored.velocity is None else _velocity(stored.velocity, stored, format, path)
    place, index_to_world = _upright(stored.index_to_world, path, format)
    if velocity is not None:
        velocity = place.field(velocity)
        velocity = replace(velocity, values=place.vectors(velocity.values))
    fields = {name: place.field(held) for name, held in stored.fields.items()}
    smoke = Volume.of_fields(place.field(density), velocity, index_to_world, frame, fields)
    return smoke if lattice is None else on_lattice(smoke, lattice, place.what)


def open_source(path: Path) -> VdbFile | None:
    """A frame's file, open to be read and then copied from, for `read_smoke` and `write_painted`.

    None of a format that has nothing to copy. Close it after use.

    Raises:
        FileFormatError: If the file cannot be read.
    """
    return open_vdb(path) if path.suffix.lower() == ".vdb" else None


def smoke_extent(path: Path, format: SmokeFormat) -> Extent:
    """The box that `read_smoke` fills without a lattice, and where it lies in the world.

    Quick where the file's headers tell.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If there is no density grid.
    """
    extent = _reader(path).extent(path, format)
    place, index_to_world = _upright(extent.index_to_world, path, format)
    return Extent(place.box(extent.box), index_to_world)


def smoke_box(
    path: str | Path, format: SmokeFormat = _ANY, *, lattice: Lattice | None = None
) -> Box:
    """The box that `read_smoke` would fill; quick where the file's headers tell.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If there is no density grid, or it can have no place on the lattice.
    """
    path = Path(path)
    box, index_to_world = smoke_extent(path, format)
    if lattice is None or box.is_empty:
        return box
    place = Placement.between(index_to_world, lattice.to_world, box, _named(path, format))
    return place.box(box)


def missing_velocity(path: Path) -> str:
    """A line for whoever expected velocity in a frame that has none: where it could be.

    Raises:
        FileFormatError: If the file cannot be read.
    """
    return f"{path}: no velocity in this frame; {_reader(path).where_velocity_is(path)}"


def with_fitted_scale(format: SmokeFormat, frames: Sequence[Frame]) -> SmokeFormat:
    """`format` with a number in place of `velocity_scale="fit"`; otherwise as it is.

    The number is the median over a few pairs of neighbouring frames that can be read.

    Raises:
        SequenceError: If no two frames are neighbours.
        GridError: If no pair has a fit.
        FileFormatError: If no pair can be read.
    """
    if format.velocity_scale != "fit":
        return format
    pairs = [(a, b) for a, b in pairwise(frames) if b.number == a.number + 1]
    if not pairs:
        raise SequenceError("velocity_scale: fit needs two neighbouring frames; set a number")
    unscaled = replace(format, velocity_scale=1.0)
    scales, failure = [], None
    for chosen in np.unique(np.linspace(0, len(pairs) - 1, _FITTED_PAIRS).round().astype(int)):
        try:
            scales.append(fit_velocity_scale(*_alike(pairs[chosen], unscaled)))
        except (GridError, FileFormatError) as error:  # noqa: PERF203
            failure = error
    if failure is not None and not scales:
        raise failure
    return replace(format, velocity_scale=median(scales))


def _alike(pair: tuple[Frame, Frame], format: SmokeFormat) -> tuple[Volume, Volume]:
    """Two frames on the lattice of the first."""
    first, second = (read_smoke(path, format, frame=number) for number, path in pair)
    named = [_named(path, format) for _, path in pair]
    lattice = Lattice.of(first.index_to_world, named[0])
    return on_lattice(first, lattice, named[0]), on_lattice(second, lattice, named[1])


def _upright(
    index_to_world: AnyArray, path: Path, format: SmokeFormat
) -> tuple[Placement, AnyArray]:
    """How the cells of a file are counted along our axes, and where they lie in our world."""
    up = up_axis_of(path, format)
    return own_cells(upright_world(index_to_world, up), _named(path, format))


def _named(path: Path, format: SmokeFormat) -> str:
    return f"{path}: grid {format.density_grid!r}"


def _reader(path: Path) -> Reader:
    return reader_of(existing_file(path))


def density_range(stored: StoredSmoke) -> tuple[float, float]:
    """The least and the greatest density, or 0 where that is less or more."""
    values = stored.density.values
    return float(values.min(initial=0)), float(values.max(initial=0))


def require_density(found: tuple[float, float], path: Path) -> None:
    """Refuse a file whose density goes so far below zero that it is none.

    Args:
        found: The least and the greatest value.
        path: The file.

    Raises:
        GridError: If it does.
    """
    least, most = found
    if least < -NEGATIVE_TOLERANCE * most:
        raise GridError(
            f"{path}: density goes from {least:g} to {most:g}; expected none below zero; "
            "choose another grid with `density_grid`"
        )


def _to_cells_per_frame(smoke: StoredSmoke, format: SmokeFormat) -> AnyArray:
    """3×3, from the file's units to cells/frame."""
    if format.velocity_scale == "fit":
        raise OptionError("velocity_scale: fit needs a sequence of frames; set a number")
    matrix = cells_per_frame(
        format.velocity_units,
        fps=format.fps,
        time_scale=format.time_scale,
        index_to_world=smoke.index_to_world,
    )
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = format.velocity_scale * matrix
    if not np.isfinite(matrix).all():
        raise OptionError(f"velocity_scale: expected a finite number, got {format.velocity_scale}")
    return matrix


def _velocity(
    velocity: StoredVelocity, smoke: StoredSmoke, format: SmokeFormat, path: Path
) -> Field:
    """Velocity at the centres of the density's cells, cells/frame, in the file's axes."""
    matrix = _to_cells_per_frame(smoke, format)  # refuses bad options, needed or not
    if velocity.in_cells_per_frame:
        matrix = np.eye(3)
    if velocity.in_cells_per_frame or format.velocity_units != "m/s":
        matrix = velocity.to_density @ matrix
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        found, known = centred(velocity.values, velocity.stored, velocity.staggered)
        if not np.array_equal(matrix, np.eye(3)):
            found.values[known.values] = found.values[known.values] @ matrix.T.astype(np.float32)
    if not (np.abs(found.values) <= FASTEST).all():
        raise GridError(
            f"{path}: velocity of more than {FASTEST:g} cells per frame, or of none that can be "
            "computed; check `velocity_units` and the voxels, or leave it out with "
            "`velocity_grid` none"
        )
    return extrapolated(found, known, EXTRAPOLATED_CELLS)[0]
