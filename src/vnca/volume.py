"""One frame of smoke, whatever file it came from."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vnca.bricks.dense import dense, field_of, shape_of
from vnca.bricks.field import Field
from vnca.bricks.refinement import refined
from vnca.errors import ShapeError
from vnca.typing import AnyArray, Box, FloatArray, Index


@dense("density", "velocity", what=lambda smoke: f"frame {smoke.frame}")
@dataclass(frozen=True, eq=False)
class Volume:
    """Density and velocity on a grid, up along +z.

    Both are arrays of all cells of a box. Smoke from files is kept as fields instead, which take
    the memory that the smoke takes, however large its box is (`density_field`, `velocity_field`);
    the arrays are made when they are asked for, and a box of far more cells than there is smoke
    in it is refused then (`GridError`).

    Attributes:
        density: `[x, y, z]`, non-negative, in the units of its file.
        velocity: `[x, y, z, 3]` at cell centres, cells per frame, or None where the file has none.
        origin: Index coordinates of cell `[0, 0, 0]`; anchors the frame in its sequence.
        index_to_world: 4×4, `world = index_to_world @ (i, j, k, 1)` for cell centres. The world is
            the file's, turned so that up is +z where it is another axis.
        frame: Frame number in its sequence.
    """

    density: FloatArray
    velocity: FloatArray | None
    origin: Index
    index_to_world: AnyArray
    frame: int

    def __post_init__(self) -> None:
        density, velocity = shape_of(self, "density"), shape_of(self, "velocity")
        if density is None or len(density) != 3:
            raise ShapeError(f"density: expected [x, y, z], got shape {density}")
        if velocity is not None and velocity != (*density, 3):
            raise ShapeError(
                f"velocity: expected {(*density, 3)} to match the density, got {velocity}"
            )

    @classmethod
    def of_fields(
        cls, density: Field, velocity: Field | None, index_to_world: AnyArray, frame: int
    ) -> "Volume":
        """Smoke given by where there is any; both fields cover one box."""
        smoke: Any = density
        motion: Any = velocity
        return cls(smoke, motion, density.origin, index_to_world, frame)

    @property
    def box(self) -> Box:
        """The cells the arrays cover, in index space."""
        shape = shape_of(self, "density") or ()
        x, y, z = (o + n for o, n in zip(self.origin, shape, strict=True))
        return Box(self.origin, (x, y, z))

    @cached_property
    def density_field(self) -> Field:
        """The density where there is any."""
        return field_of(self, "density", self.origin)

    @cached_property
    def velocity_field(self) -> Field | None:
        """The velocity where there is any."""
        return field_of(self, "velocity", self.origin)

    @property
    def voxel_size(self) -> tuple[float, float, float]:
        """World length of a cell along x, y and z."""
        x, y, z = np.linalg.norm(self.index_to_world[:3, :3], axis=0)
        return float(x), float(y), float(z)

    @property
    def cell_length(self) -> float:
        """World length of the edge of a cube as large as a cell."""
        return float(np.cbrt(abs(np.linalg.det(self.index_to_world[:3, :3]))))

    @property
    def cells_to_world(self) -> AnyArray:
        """4×4 like `index_to_world`, for cells counted from the first of the arrays."""
        matrix = self.index_to_world.copy()
        matrix[:3, 3] += matrix[:3, :3] @ self.origin
        return matrix

    def refined(self, factor: int) -> "Volume":
        """The same smoke in the same place, on a grid `factor` times as fine along each axis.

        Values are interpolated linearly between cell centres; beyond the outermost they stay. In
        cells of the finer grid velocity is `factor` times as fast.
        """
        if factor == 1:
            return self
        velocity = self.velocity_field
        if velocity is not None:
            velocity = refined(velocity, factor)
            np.multiply(velocity.values, factor, out=velocity.values)
        return Volume.of_fields(
            refined(self.density_field, factor),
            velocity,
            refined_transform(self.index_to_world, factor),
            self.frame,
        )


def refined_transform(index_to_world: AnyArray, factor: int) -> AnyArray:
    """The 4×4 matrix of cells `factor` times as fine: cell i is centred on (i + ½)/factor − ½."""
    finer = np.diag([1 / factor, 1 / factor, 1 / factor, 1.0])
    finer[:3, 3] = 0.5 / factor - 0.5
    return index_to_world @ finer
