"""One frame of smoke as arrays, whatever file it came from."""

from dataclasses import dataclass

import numpy as np

from vnca.errors import ShapeError
from vnca.typing import AnyArray, Box, FloatArray, Index


@dataclass(frozen=True, eq=False)
class Volume:
    """Density and velocity on a grid, up along +z.

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
        if self.density.ndim != 3:
            raise ShapeError(f"density: expected [x, y, z], got shape {self.density.shape}")
        if self.velocity is not None and self.velocity.shape != (*self.density.shape, 3):
            raise ShapeError(
                f"velocity: expected {(*self.density.shape, 3)} to match the density, "
                f"got {self.velocity.shape}"
            )

    @property
    def box(self) -> Box:
        """The cells the arrays cover, in index space."""
        x, y, z = (o + n for o, n in zip(self.origin, self.density.shape, strict=True))
        return Box(self.origin, (x, y, z))

    @property
    def voxel_size(self) -> tuple[float, float, float]:
        """World length of a cell along x, y and z."""
        x, y, z = np.linalg.norm(self.index_to_world[:3, :3], axis=0)
        return float(x), float(y), float(z)

    def refined(self, factor: int) -> "Volume":
        """The same smoke in the same place, on a grid `factor` times as fine along each axis.

        Values are interpolated linearly between cell centres; beyond the outermost they stay. In
        cells of the finer grid velocity is `factor` times as fast.
        """
        if factor == 1:
            return self
        velocity = self.velocity
        if velocity is not None:
            velocity = _interpolated(velocity, factor)
            velocity *= factor
        return Volume(
            _interpolated(self.density, factor),
            velocity,
            self.box.refined(factor).lower,
            refined_transform(self.index_to_world, factor),
            self.frame,
        )


def refined_transform(index_to_world: AnyArray, factor: int) -> AnyArray:
    """The 4×4 matrix of cells `factor` times as fine: cell i is centred on (i + ½)/factor − ½."""
    finer = np.diag([1 / factor, 1 / factor, 1 / factor, 1.0])
    finer[:3, 3] = 0.5 / factor - 0.5
    return index_to_world @ finer


def _interpolated(field: FloatArray, factor: int) -> FloatArray:
    """`[x, y, z, ...]` at the centres of cells `factor` times as fine."""
    for axis, cells in enumerate(field.shape[:3]):
        at = (np.arange(factor * cells) + 0.5) / factor - 0.5
        at = np.clip(at, 0, max(cells - 1, 0))
        below = at.astype(np.intp)
        above = np.minimum(below + 1, cells - 1)
        weight = (at - below).astype(np.float32).reshape(-1, *[1] * (field.ndim - axis - 1))
        # In place: the finer arrays are the largest there are.
        values, step = field.take(below, axis), field.take(above, axis)
        step -= values
        step *= weight
        values += step
        field = values
    return field
