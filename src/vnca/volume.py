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
        index_to_world: 4×4, `world = index_to_world @ (i, j, k, 1)` for cell centres.
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
