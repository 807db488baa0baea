# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cells are inside a closed mesh: where a line upwards leaves it once more than it enters."""

import numpy as np


def cells(triangles, box, index_to_world):
    """Whether the middles of cells are inside.

    Args:
        triangles: Corners `[n, 3, 3]` in the world.
        box: Of the cells.
        index_to_world: 4x4.

    Returns:
        Booleans `[x, y, z]` over the box.
    """
    to_index = np.linalg.inv(index_to_world)
    corners = triangles @ to_index[:3, :3].T + to_index[:3, 3] - box.lower
    shape = box.shape
    # How often the line downwards from a cell crosses the mesh, counted in the cell above.
    crossed = np.zeros((shape[0], shape[1], shape[2] + 1), np.int32)
    # Off the middles by less than matters, so that no line meets an edge that two triangles share.
    corners[..., :2] += 1e-5 * np.array([1.0, np.sqrt(2)])
    for a, b, c in corners:
        _cross(crossed, a, b, c)
    return np.cumsum(crossed, axis=2)[:, :, :-1] % 2 == 1


def _cross(crossed, a, b, c):
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    x0, y0 = np.maximum(np.ceil(low[:2]).astype(int), 0)
    x1, y1 = np.minimum(np.floor(high[:2]).astype(int) + 1, crossed.shape[:2])
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if x0 >= x1 or y0 >= y1 or area == 0:
        return
    x, y = np.arange(x0, x1)[:, None], np.arange(y0, y1)[None]
    of_b = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
    of_c = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
    hit = (of_b >= 0) & (of_c >= 0) & (of_b + of_c <= 1)
    z = a[2] + of_b * (b[2] - a[2]) + of_c * (c[2] - a[2])
    first_above = np.clip(np.ceil(z), 0, crossed.shape[2] - 1).astype(int)
    rows, columns = np.nonzero(hit)
    np.add.at(crossed, (rows + x0, columns + y0, first_above[hit]), 1)
