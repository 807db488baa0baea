"""How to read smoke from a file, and what was read before it is made ours."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from vnca.errors import GridError
from vnca.io.orientation import UpAxis
from vnca.io.velocity import VelocityUnits
from vnca.typing import AnyArray, BoolArray, Box, FloatArray, Index

NO_VELOCITY = "none"
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
    """Name of the velocity: one vector grid, or three scalar grids NAME.x, NAME.y and NAME.z. By
    default the first there is of velocity, vel and v; "none" reads no velocity."""

    staggered: bool | None = None
    """Whether velocity lies on the lower faces of cells. By default as the file says: by grid
    class or offset in VDB files, always in Mantaflow's npz files."""

    velocity_units: VelocityUnits = "cells/frame"
    """Units of the velocity. Blender's caches need mantaflow, with --fps and --time-scale. Files
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
        values: `[x + 1, y + 1, z + 1, 3]`, in the file's units.
        stored: `[x + 1, y + 1, z + 1]`, which cells the file has.
        staggered: Which components lie on the lower faces of their cells.
        in_cells_per_frame: Whether the file itself says so; units and scale then do not count.
    """

    values: FloatArray
    stored: BoolArray
    staggered: tuple[bool, bool, bool]
    in_cells_per_frame: bool = False


class Extent(NamedTuple):
    """Where smoke lies: the box of its cells, and their 4×4 `index_to_world`."""

    box: Box
    index_to_world: AnyArray


@dataclass(frozen=True, eq=False)
class StoredSmoke:
    """Smoke as a file has it, in the file's axes, over the box of its density.

    Attributes:
        density: `[x, y, z]`, finite.
        origin: Index coordinates of cell `[0, 0, 0]`.
        index_to_world: 4×4.
        velocity: None where the file has none, or it is not wanted.
    """

    density: FloatArray
    origin: Index
    index_to_world: AnyArray
    velocity: StoredVelocity | None

    @property
    def box(self) -> Box:
        """The cells of the density."""
        x, y, z = (o + n for o, n in zip(self.origin, self.density.shape, strict=True))
        return Box(self.origin, (x, y, z))


def up_axis_of(path: Path, format: SmokeFormat) -> UpAxis:
    """Which axis of the file points up, by the format or else by the file's suffix."""
    return format.up_axis or UP_AXES[path.suffix.lower()]


def upper_grown(box: Box) -> Box:
    """The box with one layer of cells more at its upper ends."""
    x, y, z = box.upper
    return Box(box.lower, (x + 1, y + 1, z + 1))


def single_precision(values: AnyArray, path: Path, what: str) -> FloatArray:
    """`values` as float32, all of them finite.

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
    raise GridError(
        f"{path}: {what}: {bad} of {values.size} values are NaN, infinite or beyond float32; "
        "simulate the frame again or leave it out with --frames"
    )
