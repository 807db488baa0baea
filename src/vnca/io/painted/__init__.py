"""Writing smoke as VDB files: painted frames of a sequence, and simulated ones."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from vnca.core import Box, FloatArray
from vnca.core.errors import GridError, OptionError, OutputError, ShapeError
from vnca.core.field import Field
from vnca.core.lattice import Lattice, Placement
from vnca.core.volume import Volume
from vnca.io.painted.cells import PaintedCells, finer, with_rim
from vnca.io.provenance import Provenance, without_provenance
from vnca.io.smoke_format import (
    CELLS_PER_FRAME,
    UNITS_METADATA,
    SmokeFormat,
    own_cells,
    reader_of,
    up_axis_of,
    upright_world,
)
from vnca.io.vdb import Entry, Grid, GridHeader, Transform, VdbFile, open_vdb, write_vdb
from vnca.io.vdb.header import decoded
from vnca.io.vdb_smoke import read_density

COLOUR_GRIDS = ("Cd",)
EMISSION = "emission"
"""Name of the grid of light that smoke gives of itself."""
# Metadata of a density that hold for a colour on its cells as well. All others may tell of its
# name, its type, its values or its history.
_SHARED_METADATA = ("class", "is_local_space")
# Blender's, of the cells of a grid: not true of finer ones.
_METADATA_OF_CELLS = ("file_base_resolution", "file_voxel_size")


def write_painted(
    path: str | Path,
    source: str | Path,
    format: SmokeFormat,
    *,
    density: FloatArray | Field,
    colour: FloatArray | Field,
    box: Box,
    lattice: Lattice | None = None,
    colour_grids: Sequence[str] = COLOUR_GRIDS,
    refine: int = 1,
    provenance: Provenance | None = None,
    file: VdbFile | None = None,
    emission: Field | None = None,
    beyond: int = 0,
) -> None:
    """Write a frame of a sequence with new density and colour as a VDB file.

    Both get the transform, active cells and half-float saving of the source's density, and the
    painted density its background and metadata, too. Every other grid of a VDB source is copied
    unchanged, except those the colours replace; a source without grids makes a file without. The
    file has the source's axes: of an npz source, +y up, a voxel size of 1, and its velocity.
    Refined, density and colour get the transform of the finer cells, and those with density are
    active. Where the cells painted are not the source's, colour is interpolated to those, and what
    was interpolated of the density is the factor between painted and not.

    Args:
        path: The VDB file to write.
        source: The frame that was painted.
        format: How the frame was read.
        density: `[x, y, z]` over `box`, in the units of the source; an array or a field.
        colour: `[x, y, z, 3]` over `box`, linear RGB; an array or a field.
        box: Cells covered by the arrays: at least those of the source's density.
        lattice: Whose cells these are, if `refine` is 1; those that `read_smoke` gives without one
            unless given.
        colour_grids: Names of the colour grids, several to have the colour several times.
        refine: How many times as fine as the source's the painted cells are along each axis.
        provenance: What the file's metadata is to tell of the painting.
        file: The source itself, if it is a VDB file and open already.
        emission: Light that the smoke gives, of the same cells as the colour, for a grid of its
            own.
        beyond: How many of the painted cells around those of the source there may be smoke.

    Raises:
        OptionError: If a colour grid is named like the density, or two are named alike.
        ShapeError: If the arrays do not cover the source's density.
        OutputError: If the path cannot be written, or has another suffix than `.vdb`.
        FileFormatError: If the source cannot be read.
        GridError: If the source has grids, but no density grid, or one that cannot be copied.
    """
    path, source = Path(path), Path(source)
    if density.shape != box.shape or colour.shape != (*box.shape, 3):
        raise ShapeError(
            f"painted density {density.shape} and colour {colour.shape} do not fit {box}"
        )
    lit = [] if emission is None else [EMISSION]
    names = [format.density_grid, *colour_grids, *lit]
    if len(set(names)) < len(names):
        raise OptionError(f"colour_grids: expected names of their own, got {', '.join(names)}")
    _require_vdb(path)
    if not isinstance(density, Field):
        density = Field.from_dense(density, box.lower)
    if not isinstance(colour, Field):
        colour = Field.from_dense(colour, box.lower)
    colours: dict[str, Field] = dict.fromkeys(colour_grids, colour)
    if emission is not None:
        colours[EMISSION] = emission
    frame = PaintedCells(density, colours, lattice, up_axis_of(source, format), refine, beyond)
    told = provenance.metadata if provenance else {}
    if source.suffix.lower() != ".vdb":
        _paint_other(path, source, format, frame, told)
        return
    with open_vdb(source) if file is None else nullcontext(file) as opened:
        _paint_vdb(path, opened, format, frame, told)


def write_smoke(path: str | Path, volume: Volume, *, half: bool = False) -> None:
    """Write density and velocity of a volume as a VDB file that default options read back.

    The file has +z up, and both grids only where there is density; velocity is in cells per
    frame at cell centres, which its metadata `velocity_units` records. With `half` values are
    saved as half floats.

    Raises:
        OutputError: If the path cannot be written, or has another suffix than `.vdb`.
    """
    path = Path(path)
    _require_vdb(path)
    transform = Transform.from_matrix(volume.index_to_world)
    density, velocity = volume.density_field, volume.velocity_field
    active = replace(density, values=density.values > 0, outside=False).trimmed()
    grid = partial(Grid.from_fields, transform=transform, half=half)
    grids = [grid("density", density, active, grid_class="fog volume")]
    if velocity is not None:
        units = {UNITS_METADATA: CELLS_PER_FRAME}
        grids.append(grid("velocity", velocity, active, metadata=units))
    write_vdb(path, grids)


def read_colour(
    path: Path, format: SmokeFormat, *, grid: str, box: Box, lattice: Lattice | None = None
) -> FloatArray | None:
    """Linear RGB `[x, y, z, 3]` over `box` of a painted frame, counted as by `read_smoke`.

    None where the file has no grid of that name; black where the grid has no value, or the file
    no grid at all.

    Raises:
        FileFormatError: If the file cannot be read.
        GridError: If the grid does not hold vectors of three, or can have no place on the lattice.
    """
    if path.suffix.lower() != ".vdb":
        return None
    with open_vdb(path) as file:
        if not file.grids:
            return np.zeros((*box.shape, 3), np.float32)
        if grid not in file.grids:
            return None
        header = file.grids[grid]
        what = f"{path}: grid '{grid}'"
        if not header.value_type.startswith("vec3"):
            raise GridError(f"{what} holds {header.value_type}, not a colour; see `colour_grid`")
        stored = header.read()
        own = upright_world(header.transform.index_to_world, up_axis_of(path, format))
        ours = own_cells(own, what)[1] if lattice is None else lattice.to_world
        cells = stored.active_box()
        place = Placement.between(own, ours, cells, what)
        if place.is_whole:
            cells = place.inverse.box(box)
        stored, active = stored.fields(cells)
    values = place.field(replace(stored, values=stored.values.astype(np.float32)), box)
    if not place.is_whole:
        # Between a colour and nothing lies that colour.
        share = place.field(replace(active, values=active.values.astype(np.float32)), box)
        share = share.blocks(values.bricks)[..., None]
        np.divide(values.values, share, out=values.values, where=share > 0)
    return values.dense(box)


def _paint_vdb(
    path: Path,
    file: VdbFile,
    format: SmokeFormat,
    frame: PaintedCells,
    told: Mapping[str, Entry],
) -> None:
    about = {**without_provenance(file.metadata), **told}
    if not file.grids:
        write_vdb(path, [], metadata=about)
        return
    header, old, cells = read_density(file, format)
    transform = finer(old.transform, frame.refine)
    density, colours = frame.stored(old, *old.fields(cells), f"{file.path}: grid {header.name!r}")
    background = old.tree.background
    new = Grid.from_fields(old.name, *density, like=old, transform=transform, background=background)
    shared = shared_metadata(old)
    made = [
        Grid.from_fields(name, *colour, transform=transform, metadata=shared, half=old.is_half)
        for name, colour in colours.items()
    ]
    write_vdb(path, among(file, header, new, made, refine=frame.refine), metadata=about)


def among(
    file: VdbFile, header: GridHeader, density: Grid, colours: Sequence[Grid], *, refine: int
) -> list[Grid | GridHeader]:
    """The grids of a painted file: those of its source, with new ones in their places.

    Args:
        file: The source.
        header: Its density.
        density: What takes that one's place.
        colours: What else is new.
        refine: How many times as fine the new ones are.
    """
    for name in _METADATA_OF_CELLS if refine > 1 else ():
        density.metadata.pop(name, None)
    names = {grid.name for grid in colours}
    kept: list[Grid | GridHeader] = [
        density if name == header.name else other
        for name, other in file.grids.items()
        if name == header.name or decoded(other.grid_name) not in names
    ]
    return [*kept, *colours]


def shared_metadata(density: Grid) -> Mapping[str, Entry]:
    """Of a density, what holds for a colour on its cells as well."""
    return {n: density.metadata[n] for n in _SHARED_METADATA if n in density.metadata}


def _paint_other(
    path: str | Path,
    source: str | Path,
    format: SmokeFormat,
    frame: PaintedCells,
    told: Mapping[str, Entry],
) -> None:
    stored = reader_of(Path(source)).read(Path(source), format)
    transform = Transform.from_matrix(stored.index_to_world)
    before = stored.density
    density, colours = frame.in_file(transform, before, str(source))
    active = frame.active(density, replace(before, values=before.values != 0, outside=False))
    colours, coloured = with_rim(colours, active)
    grids = [
        Grid.from_fields(
            name,
            values,
            stored,
            transform=finer(transform, frame.refine),
            grid_class="fog volume",
        )
        for name, values, stored in [
            (format.density_grid, density, active),
            *((name, colour, coloured) for name, colour in colours.items()),
        ]
    ]
    if (velocity := stored.velocity) is not None:
        grids.append(
            Grid.from_fields(
                "velocity",
                velocity.values,
                velocity.stored,
                transform=transform,
                grid_class="staggered" if all(velocity.staggered) else None,
                metadata={UNITS_METADATA: CELLS_PER_FRAME} if velocity.in_cells_per_frame else {},
            )
        )
    write_vdb(path, grids, metadata=told)


def _require_vdb(path: Path) -> None:
    if path.suffix.lower() != ".vdb":
        raise OutputError(
            f"{path}: smoke is written as .vdb, not {path.suffix or 'without suffix'}"
        )
