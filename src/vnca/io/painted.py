"""Writing smoke as VDB files: painted frames of a sequence, and simulated ones."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.errors import GridError, OptionError, OutputError, ShapeError
from vnca.core.field import Field, dilated, divided
from vnca.core.lattice import Lattice, Placement
from vnca.core.volume import Volume, refined_transform
from vnca.io.provenance import Provenance, without_provenance
from vnca.io.smoke_format import (
    CELLS_PER_FRAME,
    UNITS_METADATA,
    SmokeFormat,
    UpAxis,
    on_lattice,
    own_cells,
    reader_of,
    up_axis_of,
    upright_world,
)
from vnca.io.vdb import (
    VALUE_TYPES,
    Entry,
    Grid,
    GridHeader,
    Transform,
    VdbFile,
    open_vdb,
    write_vdb,
)
from vnca.io.vdb.header import decoded
from vnca.io.vdb_smoke import read_density
from vnca.io.velocity import extrapolated

COLOUR_GRIDS = ("Cd",)
EMISSION = "emission"
"""Name of the grid of light that smoke gives of itself."""
# Metadata of a density that hold for a colour on its cells as well. All others may tell of its
# name, its type, its values or its history.
_SHARED_METADATA = ("class", "is_local_space")
# Blender's, of the cells of a grid: not true of finer ones.
_METADATA_OF_CELLS = ("file_base_resolution", "file_voxel_size")
_HALF_MOST = float(np.finfo(np.float16).max)


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
    frame = _Painting(density, colours, lattice, up_axis_of(source, format), refine, beyond)
    told = provenance.metadata if provenance else {}
    if source.suffix.lower() != ".vdb":
        _paint_other(path, source, format, frame, told)
        return
    with open_vdb(source) if file is None else nullcontext(file) as opened:
        _paint_vdb(path, opened, format, frame, told)


def write_smoke(path: str | Path, volume: Volume) -> None:
    """Write density and velocity of a volume as a VDB file that default options read back.

    The file has +z up, and both grids only where there is density; velocity is in cells per
    frame at cell centres, which its metadata `velocity_units` records.

    Raises:
        OutputError: If the path cannot be written, or has another suffix than `.vdb`.
    """
    path = Path(path)
    _require_vdb(path)
    transform = Transform.from_matrix(volume.index_to_world)
    density, velocity = volume.density_field, volume.velocity_field
    active = replace(density, values=density.values > 0, outside=False).trimmed()
    grids = [
        Grid.from_fields("density", density, active, transform=transform, grid_class="fog volume")
    ]
    if velocity is not None:
        units = {UNITS_METADATA: CELLS_PER_FRAME}
        grids.append(
            Grid.from_fields("velocity", velocity, active, transform=transform, metadata=units)
        )
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


@dataclass(frozen=True, eq=False)
class _Painting:
    """What was painted, and where its cells lie.

    Attributes:
        density: Of cells `refine` times as fine as those of the lattice.
        colours: Of the same cells, each under the name that it gets.
        lattice: None for those of the source, along our axes.
        up: Which axis of the source's world points up.
        refine: How fine they are.
        beyond: How many cells around those of the source there may be smoke.
    """

    density: Field
    colours: Mapping[str, Field]
    lattice: Lattice | None
    up: UpAxis
    refine: int
    beyond: int

    def in_file(
        self, transform: Transform, density: Field, what: str
    ) -> tuple[Field, dict[str, Field]]:
        """Density and colours of the file's cells, or as fine ones.

        Args:
            transform: Of the file's cells.
            density: Theirs before they were painted, as the file has it.
            what: What a message calls them.

        Raises:
            ShapeError: If some of them were not painted.
        """
        world, cells = upright_world(transform.index_to_world, self.up), density.box
        ours = own_cells(world, what)[1]
        if self.lattice is not None and not cells.is_empty:
            ours = self.lattice.to_world
        needed = Placement.between(world, ours, cells, what).box(cells).refined(self.refine)
        painted = self.density.box
        if painted.union(needed) != painted:
            raise ShapeError(f"{what}: smoke in {needed}, but only {painted} was painted")
        over = cells.refined(self.refine)
        if not over.is_empty:
            over = over.grown(self.beyond)
        source, target = (refined_transform(matrix, self.refine) for matrix in (world, ours))
        back = Placement.between(source, target, over, what).inverse
        # Of a colour that has several names there is one field.
        named = {id(colour): colour for colour in self.colours.values()}
        moved = {key: back.field(colour, over, "nearest") for key, colour in named.items()}
        colours = {name: moved[id(colour)] for name, colour in self.colours.items()}
        if back.is_whole or self.beyond:
            return back.field(self.density, over), colours
        positive = np.maximum(density.values.astype(np.float32), 0)
        plain = Volume.of_fields(replace(density, values=positive), None, world, 0)
        change = self._change(on_lattice(plain, Lattice(ours), what).refined(self.refine))
        # Of what is nothing everywhere, nothing comes of interpolation.
        change = back.field(change, over, "nearest")
        finer = plain.refined(self.refine).density_field
        return replace(finer, values=finer.values * (1 + change.blocks(finer.bricks))), colours

    def active(self, density: Field, of_file: Field, background: AnyArray | float = 0) -> Field:
        """Which cells to store; `of_file` are active in the file."""
        if self.refine == 1 and not self.beyond:
            return of_file
        dense = replace(density, values=density.values != 0, outside=False).trimmed()
        # A cell that is not stored would not be empty.
        keeps = background or self.refine == 1
        return dense.union(divided(of_file, self.refine)) if keeps else dense

    def transform(self, of_file: Transform) -> Transform:
        """That of the painted cells; `of_file` is that of the file's."""
        if self.refine == 1:
            return of_file
        return Transform.from_matrix(refined_transform(of_file.index_to_world, self.refine))

    def _change(self, plain: Volume) -> Field:
        """What the painting multiplied the density by, less 1; 0 where there was none."""
        before = plain.density_field
        factor, painted = np.ones_like(before.values), self.density.blocks(before.bricks)
        np.divide(painted, before.values, out=factor, where=before.values > 0)
        return Field(before.bricks, factor - 1, self.density.box)


def _with_rim(colours: Mapping[str, Field], active: Field) -> tuple[dict[str, Field], Field]:
    """Colours that go on for a cell around the smoke, and the cells that have one.

    Renderers interpolate density and colour one by one: beside black, the border of opaque smoke
    would be dark.
    """
    box = active.box.grown(1)
    active = replace(active, box=box)
    # A cell at a corner is three steps away.
    wide = {n: extrapolated(replace(c, box=box), active, 3)[0] for n, c in colours.items()}
    return wide, dilated(active, 1)


def _paint_vdb(
    path: Path,
    file: VdbFile,
    format: SmokeFormat,
    frame: _Painting,
    told: Mapping[str, Entry],
) -> None:
    about = {**without_provenance(file.metadata), **told}
    if not file.grids:
        write_vdb(path, [], metadata=about)
        return
    header, old, cells = read_density(file, format)
    what = f"{file.path}: grid {header.name!r}"
    before, active = old.fields(cells)
    density, colours = frame.in_file(old.transform, before, what)
    background = old.tree.background
    active = frame.active(density, active, background)
    colours, coloured = _with_rim(colours, active)
    transform = frame.transform(old.transform)
    dtype = VALUE_TYPES[old.value_type].dtype
    if dtype.kind != "f":
        dtype = np.dtype(np.float32)
    if old.is_half or dtype.itemsize == 2:
        density = _as_half(density)
        colours = {name: _as_half(colour) for name, colour in colours.items()}
    density = replace(density, values=density.values.astype(dtype))
    new = Grid.from_fields(
        old.name, density, active, like=old, transform=transform, background=background
    )
    for name in _METADATA_OF_CELLS if frame.refine > 1 else ():
        new.metadata.pop(name, None)
    grids: list[Grid | GridHeader] = [
        new if name == header.name else other
        for name, other in file.grids.items()
        if name == header.name or decoded(other.grid_name) not in colours
    ]
    shared = {name: old.metadata[name] for name in _SHARED_METADATA if name in old.metadata}
    grids += [
        Grid.from_fields(
            name, colour, coloured, transform=transform, metadata=shared, half=old.is_half
        )
        for name, colour in colours.items()
    ]
    write_vdb(path, grids, metadata=about)


def _as_half(field: Field) -> Field:
    """Values that a half float can hold."""
    return replace(field, values=np.clip(field.values, -_HALF_MOST, _HALF_MOST))


def _paint_other(
    path: str | Path,
    source: str | Path,
    format: SmokeFormat,
    frame: _Painting,
    told: Mapping[str, Entry],
) -> None:
    stored = reader_of(Path(source)).read(Path(source), format)
    transform = Transform.from_matrix(stored.index_to_world)
    before = stored.density
    density, colours = frame.in_file(transform, before, str(source))
    active = frame.active(density, replace(before, values=before.values != 0, outside=False))
    colours, coloured = _with_rim(colours, active)
    grids = [
        Grid.from_fields(
            name,
            values,
            stored,
            transform=frame.transform(transform),
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
