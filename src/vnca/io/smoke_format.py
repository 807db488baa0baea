"""How smoke is read from a file, what is read before it is made ours, and how it becomes ours.

In our world up is +z. A file's world with y up is turned: ours is (x, y, z) = its (z, x, y), a
rotation without flips. Its cells keep their places in it, but are counted along our axes: in a file
whose index axes are exchanged or mirrored, too, cells go to the right, back and up. Writers go the
same way back.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, FloatArray
from vnca.core.errors import FileFormatError, GridError, OptionError
from vnca.core.field import Field
from vnca.core.lattice import Lattice, Placement, upright_turn
from vnca.core.volume import Volume
from vnca.io.velocity import VelocityUnits

UpAxis: TypeAlias = Literal["z", "y"]

# For each axis of our world, the file's.
_WORLD_AXES: dict[UpAxis, list[int]] = {"z": [0, 1, 2, 3], "y": [2, 0, 1, 3]}
NO_VELOCITY = "none"
NOT_WANTED = "`velocity_grid` none says that none is wanted"
# What a velocity grid's metadata says of its units, where it was written by vnca.
UNITS_METADATA = "velocity_units"
CELLS_PER_FRAME: VelocityUnits = "cells/frame"
# Files of smoke by suffix, and the module whose `READER` reads them.
_HOMES = {".vdb": "vnca.io.vdb_smoke", ".npz": "vnca.io.npz"}
_READERS: dict[str, "Reader"] = {}


def upright_world(index_to_world: AnyArray, up: UpAxis) -> AnyArray:
    """4×4, from a file's cells to the world, where `up` points up there and +z does here."""
    return index_to_world[_WORLD_AXES[up]]


def own_cells(index_to_world: AnyArray, what: str) -> tuple[Placement, AnyArray]:
    """How a grid's own cells are counted along our axes, and their 4×4 `index_to_world`.

    Args:
        index_to_world: 4×4, from the grid's cells to our world.
        what: What a message calls it.
    """
    turn = upright_turn(index_to_world)
    return Placement(turn.T, True, what), index_to_world @ turn


def on_lattice(smoke: Volume, lattice: Lattice, what: str) -> Volume:
    """A frame on the cells of a lattice, to which its own are moved or its smoke interpolated.

    Velocity is in cells per frame of the lattice then. Smoke fades over a cell into what its box
    leaves out, as in OpenVDB; velocity goes on as at the border.

    Args:
        smoke: The frame.
        lattice: The lattice.
        what: What a message calls the frame.

    Raises:
        GridError: If its axes are not at right angles, or it takes too many cells.
    """
    if smoke.box.is_empty:
        return replace(smoke, origin=(0, 0, 0), index_to_world=lattice.to_world)
    place = Placement.between(smoke.index_to_world, lattice.to_world, smoke.box, what)
    over = place.box(smoke.box)
    velocity = smoke.velocity_field
    if velocity is not None:
        velocity = place.field(velocity, over, "nearest")
        velocity = replace(velocity, values=place.vectors(velocity.values))
    density = place.field(smoke.density_field, over)
    fields = {name: place.field(held, over) for name, held in smoke.named_fields.items()}
    return Volume.of_fields(density, velocity, lattice.to_world, smoke.frame, fields)


def on_one_lattice(frames: Iterable[Volume]) -> Iterator[Volume]:
    """Frames on the lattice of the first that has smoke, whose cells must be cubic.

    Raises:
        GridError: If they are not, or a frame can have no place on them.
    """
    lattice = None
    for smoke in frames:
        what = f"frame {smoke.frame}"
        if lattice is None and not smoke.box.is_empty:
            lattice = Lattice.as_it_is(smoke.index_to_world, what)
        yield smoke if lattice is None else on_lattice(smoke, lattice, what)


@dataclass(frozen=True)
class SmokeFormat:
    """How to read smoke from files."""

    density_grid: str = "density"
    """Name of the density grid."""

    velocity_grid: str | None = None
    """Name of the velocity: one vector grid, or three scalar grids such as NAME.x, NAME.y and
    NAME.z. By default velocity, vel or v, also as Velocity, vel_x or velX; "none" reads none."""

    staggered: bool | None = None
    """Whether velocity lies on the lower faces of cells. By default as the file says: by grid
    class or offset in VDB files, always in Mantaflow's npz files."""

    velocity_units: VelocityUnits = "cells/frame"
    """Units of the velocity. Blender's caches need mantaflow, with `fps` and `time_scale`. Files
    that `vnca simulate` wrote say their own, which count instead of these options."""

    fps: float = 24.0
    """Frames a second, for the units m/s and mantaflow."""

    time_scale: float = 1.0
    """The simulation's time scale, for the units m/s and mantaflow."""

    velocity_scale: float | Literal["fit"] = 1.0
    """A further factor on the velocity; "fit" finds it by carrying frames onto their next."""

    fields: tuple[str, ...] = ()
    """Further grids of numbers to read, such as temperature, on the cells of the density: for rules
    that are conditioned on them."""

    up_axis: UpAxis | None = None
    """Which axis of the file points up. By default z in VDB files, y in npz files."""


@dataclass(frozen=True, eq=False)
class StoredVelocity:
    """Velocity as a file has it, with one layer of cells more than the density at upper ends.

    Attributes:
        values: `[..., 3]`, in the file's units.
        stored: Which cells the file has.
        staggered: Which components lie on the lower faces of their cells.
        in_cells_per_frame: Whether the file itself says so; units and scale then do not count.
        to_density: 3×3, from cells of the velocity's own grid to the density's. Units of cells
            are of those, units of the world know none.
    """

    values: Field
    stored: Field
    staggered: tuple[bool, bool, bool]
    in_cells_per_frame: bool = False
    to_density: AnyArray = field(default_factory=lambda: np.eye(3))


class Extent(NamedTuple):
    """Where smoke lies: the box of its cells, and their 4×4 `index_to_world`."""

    box: Box
    index_to_world: AnyArray


@dataclass(frozen=True, eq=False)
class StoredSmoke:
    """Smoke as a file has it, in the file's axes.

    Attributes:
        density: Over the box of its cells, finite.
        index_to_world: 4×4.
        velocity: None where the file has none, or it is not wanted.
        fields: What else was asked for, by name, over the same cells.
    """

    density: Field
    index_to_world: AnyArray
    velocity: StoredVelocity | None
    fields: Mapping[str, Field] = field(default_factory=dict)


@dataclass(frozen=True)
class Reader:
    """A file format that holds smoke.

    Attributes:
        read: Reads a frame in the axes of its file.
        extent: The cells that hold smoke, in the axes of the file.
        where_velocity_is: What to tell whoever expected velocity in a frame that has none.
        up_axis: Which axis of the file points up unless the user says otherwise.
    """

    read: Callable[[Path, SmokeFormat], StoredSmoke]
    extent: Callable[[Path, SmokeFormat], Extent]
    where_velocity_is: Callable[[Path], str]
    up_axis: UpAxis


def suffixes() -> tuple[str, ...]:
    """Of the files that can be read, in small letters: `.vdb`, `.npz`, and what was registered."""
    return tuple({**_HOMES, **_READERS})


def register_reader(suffix: str, reader: Reader) -> None:
    """Read files of a suffix so, from here on.

    Raises:
        OptionError: If the suffix is none, or one of vnca's own.
    """
    if suffix in _HOMES or suffix.lower() != suffix or not suffix.startswith("."):
        raise OptionError(
            f"`suffix` {suffix!r}: expected one such as '.smoke' in small letters, other than "
            f"{' and '.join(_HOMES)}"
        )
    _READERS[suffix] = reader


def reader_of(path: Path) -> Reader:
    """What reads a file, by its suffix.

    Raises:
        FileFormatError: If no format has it.
    """
    suffix = path.suffix.lower()
    if suffix in _HOMES:
        return import_module(_HOMES[suffix]).READER
    if suffix not in _READERS:
        raise FileFormatError(
            f"{path}: expected a file of smoke ({', '.join(suffixes())}), got {suffix or 'none'}"
        )
    return _READERS[suffix]


def up_axis_of(path: Path, format: SmokeFormat) -> UpAxis:
    """Which axis of the file points up, by the format or else by the file's suffix."""
    return format.up_axis or reader_of(path).up_axis


def upper_grown(box: Box) -> Box:
    """The box with one layer of cells more at its upper ends."""
    x, y, z = box.upper
    return Box(box.lower, (x + 1, y + 1, z + 1))


def single_precision(
    values: AnyArray, path: Path, what: str, *, stored: BoolArray | None = None
) -> FloatArray:
    """`values` as float32, all of them finite.

    Args:
        values: Any numbers.
        path: Where they are from, for the message.
        what: What they are, for the message.
        stored: Which of them the message counts: those the file has; all unless given.

    Raises:
        GridError: If any is NaN or infinite, or too large for float32.
    """
    with np.errstate(over="ignore"):
        values = np.asarray(values, np.float32)
    # A sum is finite only if every value is, and a lot cheaper than looking at each.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(np.sum(values, dtype=np.float64)):
            return values
    bad = values.size - int(np.count_nonzero(np.isfinite(values)))
    count = values.size if stored is None else values[stored].size
    raise GridError(
        f"{path}: {what}: {bad} of {count} values are NaN, infinite or beyond float32; "
        "simulate the frame again or leave it out with `frames`"
    )
