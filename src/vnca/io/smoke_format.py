"""How to read smoke from a file, and what was read before it is made ours."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from vnca.core.bricks.field import Field
from vnca.core.errors import GridError
from vnca.core.typing import AnyArray, BoolArray, Box, FloatArray
from vnca.io.orientation import UpAxis
from vnca.io.velocity import VelocityUnits

NO_VELOCITY = "none"
NOT_WANTED = "`velocity_grid` none says that none is wanted"
# What a velocity grid's metadata says of its units, where it was written by vnca.
UNITS_METADATA = "velocity_units"
CELLS_PER_FRAME: VelocityUnits = "cells/frame"
# Files of smoke by suffix, and which of their axes points up unless the user says otherwise.
UP_AXES: dict[str, UpAxis] = {".vdb": "z", ".npz": "y"}


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
    """

    density: Field
    index_to_world: AnyArray
    velocity: StoredVelocity | None


def up_axis_of(path: Path, format: SmokeFormat) -> UpAxis:
    """Which axis of the file points up, by the format or else by the file's suffix."""
    return format.up_axis or UP_AXES[path.suffix.lower()]


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
