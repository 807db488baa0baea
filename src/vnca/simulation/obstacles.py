"""Meshes as obstacles: which cells they fill."""

import numpy as np

from vnca.core import AnyArray, BoolArray
from vnca.core.errors import OptionError
from vnca.simulation.scenes import Stage

_SIZE, _FLOOR = 0.5, 0.1
"""Widths: of the mesh's longest side, and from the floor of the box to its lowest point."""


def solid_of(vertices: AnyArray, triangles: AnyArray, stage: Stage) -> BoolArray:
    """The cells `[x, y, z]` of a stage whose centres a mesh encloses, stood in its middle.

    A cell is inside where a line straight up from the floor has met the surface an odd number of
    times: small holes in the mesh leave columns, large ones make no solid of it.

    Args:
        vertices: `[n, 3]`, up +z, of any size.
        triangles: `[m, 3]`, indices of vertices.
        stage: Where it is to stand.

    Raises:
        OptionError: If it has no extent, or encloses no cell.
    """
    low, high = vertices.min(0), vertices.max(0)
    longest = float((high - low).max())
    if not longest > 0:
        raise OptionError("`mesh`: has no extent")
    shape, cells = stage.smoke.density.shape, stage.resolution
    scale = _SIZE * cells / longest
    middle = [*(low[:2] + high[:2]) / 2, low[2]]
    place = [*(np.array(shape[:2]) - 1) / 2, _FLOOR * cells]
    corners = ((vertices - middle) * scale + place)[triangles]
    # Not exactly through edges, which two triangles share.
    corners = corners + np.array([1e-4, 2.3e-4, 0.0])
    crossings = np.zeros(shape, np.int32)
    for corner in corners:
        _cross(crossings, corner)
    solid = (crossings.cumsum(axis=2) % 2).astype(bool)
    if not solid.any():
        raise OptionError("`mesh`: encloses no cell; is it closed, and the resolution enough?")
    return solid


def _cross(crossings: AnyArray, corner: AnyArray) -> None:
    """Count, for each column under a triangle, the first cell centre above it."""
    (ax, ay, _), (bx, by, _), (cx, cy, _) = corner
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area == 0:
        return
    low = np.maximum(np.ceil(corner[:, :2].min(0)), 0).astype(int)
    high = np.minimum(np.floor(corner[:, :2].max(0)) + 1, crossings.shape[:2]).astype(int)
    if (low >= high).any():
        return
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
    second = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
    third = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
    inside = (second >= 0) & (third >= 0) & (second + third <= 1)
    height = corner[0, 2] * (1 - second - third) + corner[1, 2] * second + corner[2, 2] * third
    above = np.ceil(height[inside]).astype(int)
    fits = above < crossings.shape[2]
    at = (x[inside][fits], y[inside][fits], np.maximum(above[fits], 0))
    np.add.at(crossings, at, 1)
