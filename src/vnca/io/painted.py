"""Writing smoke as VDB files: painted frames of a sequence, and simulated ones."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vnca.errors import GridError, OptionError, OutputError, ShapeError
from vnca.io.npz import read_npz_smoke
from vnca.io.orientation import box_to_file, to_file, to_internal
from vnca.io.smoke_format import CELLS_PER_FRAME, UNITS_METADATA, SmokeFormat, up_axis_of
from vnca.io.vdb import VALUE_TYPES, Grid, GridHeader, Transform, open_vdb, write_vdb
from vnca.io.vdb.header import decoded
from vnca.io.vdb_smoke import read_density
from vnca.typing import BoolArray, Box, FloatArray
from vnca.volume import Volume, refined_transform

COLOUR_GRIDS = ("Cd",)
_HALF_MOST = float(np.finfo(np.float16).max)


def write_painted(
    path: Path,
    source: Path,
    format: SmokeFormat,
    *,
    density: FloatArray,
    colour: FloatArray,
    box: Box,
    colour_grids: Sequence[str] = COLOUR_GRIDS,
    refine: int = 1,
) -> None:
    """Write a frame of a sequence with new density and colour as a VDB file.

    Both get the transform, metadata, active cells and half-float saving of the source's density;
    every other grid of a VDB source is copied unchanged, except those the colours replace. The
    file has the source's axes: of an npz source, +y up, a voxel size of 1, and its velocity.
    Refined, density and colour get the transform of the finer cells, and those with density are
    active.

    Args:
        path: The VDB file to write.
        source: The frame that was painted.
        format: How the frame was read.
        density: `[x, y, z]` over `box`, in the units of the source.
        colour: `[x, y, z, 3]` over `box`, linear RGB.
        box: Cells covered by the arrays, in our axes: at least those of the source's density.
        colour_grids: Names of the colour grids, several to have the colour several times.
        refine: How many times as fine as the source's the painted cells are along each axis.

    Raises:
        OptionError: If a colour grid is named like the density, or two are named alike.
        ShapeError: If the arrays do not cover the source's density.
        OutputError: If the path cannot be written, or has another suffix than `.vdb`.
        FileFormatError: If the source cannot be read.
        GridError: If the source has no density grid.
    """
    if density.shape != box.shape or colour.shape != (*box.shape, 3):
        raise ShapeError(
            f"painted density {density.shape} and colour {colour.shape} do not fit {box}"
        )
    names = [format.density_grid, *colour_grids]
    if len(set(names)) < len(names):
        raise OptionError(f"colour_grids: expected names of their own, got {', '.join(names)}")
    _require_vdb(path)
    up = up_axis_of(source, format)
    frame = _Painting(to_file(density, up), to_file(colour, up), box_to_file(box, up), refine)
    write = _paint_npz if source.suffix.lower() == ".npz" else _paint_vdb
    write(path, source, format, frame, colour_grids)


def write_smoke(path: Path, volume: Volume) -> None:
    """Write density and velocity of a volume as a VDB file that default options read back.

    The file has +z up, and both grids only where there is density; velocity is in cells per
    frame at cell centres, which its metadata `velocity_units` records.

    Raises:
        OutputError: If the path cannot be written, or has another suffix than `.vdb`.
    """
    _require_vdb(path)
    transform = Transform.from_matrix(volume.index_to_world)
    active = volume.density > 0
    grids = [
        Grid.from_dense(
            "density",
            volume.density,
            active,
            volume.origin,
            transform=transform,
            grid_class="fog volume",
        )
    ]
    if volume.velocity is not None:
        grids.append(
            Grid.from_dense(
                "velocity",
                volume.velocity,
                active,
                volume.origin,
                transform=transform,
                metadata={UNITS_METADATA: CELLS_PER_FRAME},
            )
        )
    write_vdb(path, grids)


def read_colour(path: Path, format: SmokeFormat, *, grid: str, box: Box) -> FloatArray | None:
    """Linear RGB `[x, y, z, 3]` over `box`, in our axes, of a painted frame.

    None where the file has no grid of that name; black where the grid has no value.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If the grid does not hold vectors of three.
    """
    if path.suffix.lower() != ".vdb":
        return None
    up = up_axis_of(path, format)
    with open_vdb(path) as file:
        if grid not in file.grids:
            return None
        header = file.grids[grid]
        if not header.value_type.startswith("vec3"):
            raise GridError(
                f"{path}: grid '{grid}' holds {header.value_type}, not a colour; see --colour-grid"
            )
        values, _ = header.read().to_dense(box_to_file(box, up), fill=0)
    return to_internal(values.astype(np.float32), up)


class _Painting(NamedTuple):
    """Painted arrays in the axes of a file."""

    density: FloatArray
    colour: FloatArray
    box: Box
    refine: int

    def over(self, cells: Box, source: Path) -> "_Painting":
        """The part of it that covers `cells` of the file.

        Raises:
            ShapeError: If some of them were not painted.
        """
        cells = cells.refined(self.refine)
        if self.box.union(cells) != self.box:
            raise ShapeError(f"{source}: smoke in {cells}, but only {self.box} was painted")
        inside = cells.slices(self.box)
        return _Painting(self.density[inside], self.colour[inside], cells, self.refine)

    def active(self, of_file: BoolArray) -> BoolArray:
        """Which cells to store; `of_file` are active in the file."""
        return of_file if self.refine == 1 else self.density != 0

    def transform(self, of_file: Transform) -> Transform:
        """That of the painted cells; `of_file` is that of the file's."""
        if self.refine == 1:
            return of_file
        return Transform.from_matrix(refined_transform(of_file.index_to_world, self.refine))


def _paint_vdb(
    path: Path, source: Path, format: SmokeFormat, frame: _Painting, colour_grids: Sequence[str]
) -> None:
    with open_vdb(source) as file:
        header, old, cells = read_density(file, format)
        frame = frame.over(cells, source)
        active = frame.active(old.to_dense(cells)[1])
        transform, origin = frame.transform(old.transform), frame.box.lower
        density, colour = frame.density, frame.colour
        dtype = VALUE_TYPES[old.value_type].dtype
        if dtype.kind != "f":
            dtype = np.dtype(np.float32)
        if old.is_half or dtype.itemsize == 2:
            density, colour = (np.clip(a, -_HALF_MOST, _HALF_MOST) for a in (density, colour))
        new = Grid.from_dense(
            old.name, density.astype(dtype), active, origin, like=old, transform=transform
        )
        grids: list[Grid | GridHeader] = [
            new if name == header.name else other
            for name, other in file.grids.items()
            if name == header.name or decoded(other.grid_name) not in colour_grids
        ]
        grids += [
            Grid.from_dense(name, colour, active, origin, like=old, transform=transform)
            for name in colour_grids
        ]
        write_vdb(path, grids, metadata=file.metadata)


def _paint_npz(
    path: Path, source: Path, format: SmokeFormat, frame: _Painting, colour_grids: Sequence[str]
) -> None:
    stored = read_npz_smoke(source, format)
    origin, transform = stored.origin, Transform.from_matrix(stored.index_to_world)
    x, y, z = (start + cells for start, cells in zip(origin, stored.density.shape, strict=True))
    frame = frame.over(Box(origin, (x, y, z)), source)
    active = frame.active(stored.density != 0)
    grids = [
        Grid.from_dense(
            name,
            values,
            active,
            frame.box.lower,
            transform=frame.transform(transform),
            grid_class="fog volume",
        )
        for name, values in [
            (format.density_grid, frame.density),
            *((name, frame.colour) for name in colour_grids),
        ]
    ]
    if (velocity := stored.velocity) is not None:
        grids.append(
            Grid.from_dense(
                "velocity",
                velocity.values,
                velocity.stored,
                origin,
                transform=transform,
                grid_class="staggered" if all(velocity.staggered) else None,
            )
        )
    write_vdb(path, grids)


def _require_vdb(path: Path) -> None:
    if path.suffix.lower() != ".vdb":
        raise OutputError(
            f"{path}: smoke is written as .vdb, not {path.suffix or 'without suffix'}"
        )
