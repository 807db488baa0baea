"""Triangles of polygons, concave ones too."""

import numpy as np

from vnca.errors import BackendUnavailableError
from vnca.typing import AnyArray

_ROUNDING = 1e-12
"""Share of a polygon's area by which a triangle may seem turned over."""
_STARTS = 8
"""Corners around which a fan is tried: one of them will do for most polygons, and for all quads."""


def triangulated(points: AnyArray, counts: AnyArray, corners: AnyArray) -> AnyArray:
    """Triangles that cover polygons, each wound as its polygon is.

    A polygon that its triangles around one of the first corners cover is a fan of these; any other
    is triangulated in the plane that fits it best. Polygons of fewer than three corners are
    dropped; of others no corner is.

    Args:
        points: `[v, 3]`.
        counts: `[p]`, corners of each polygon.
        corners: `[c]`, rows of `points`, polygon by polygon.

    Returns:
        `[t, 3]`, rows of `corners`, in the order of the polygons.

    Raises:
        ValueError: If a corner is not among the points.
        BackendUnavailableError: If mapbox-earcut is needed and not installed.
    """
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        raise ValueError("a face has a vertex that is not there")
    counts = np.asarray(counts, np.int64)
    starts = np.cumsum(counts) - counts
    triangles, polygon = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        left = np.flatnonzero(counts == count)
        for first in range(min(count, _STARTS)):
            ring = np.roll(np.arange(count), -first)
            rings = starts[left, None] + ring
            covered = _covered(points[corners[rings]]) if count > 3 else np.ones(len(left), bool)
            triangles.append(rings[covered][:, _fan(count)].reshape(-1, 3))
            polygon.append(np.repeat(left[covered], count - 2))
            left = left[~covered]
            if not len(left):
                break
        for this in left:
            ring = starts[this] + np.arange(count)
            # A quad that no fan covers crosses itself.
            cut = _cut(points[corners[ring]]) if count > 4 else _fan(count)
            triangles.append(ring[cut])
            polygon.append(np.full(len(cut), this))
    order = np.argsort(np.concatenate(polygon), kind="stable")
    return np.concatenate(triangles)[order]


def _fan(count: int) -> AnyArray:
    """`[count - 2, 3]`: triangles around the first corner."""
    second = np.arange(1, count - 1)
    return np.stack([np.zeros_like(second), second, second + 1], 1)


def _covered(rings: AnyArray) -> AnyArray:
    """Whether triangles around the first corner cover polygons `[p, n, 3]`, each once.

    Where none is turned over, none lies outside the polygon.
    """
    normals = _fan_normals(rings)
    whole = normals.sum(1)
    along = np.einsum("pkc,pc->pk", normals, whole)
    return (along >= -_ROUNDING * (whole**2).sum(1)[:, None]).all(1)


def _fan_normals(rings: AnyArray) -> AnyArray:
    """`[p, n - 2, 3]`, twice as long as the areas; their sum is Newell's normal of the polygon.

    Reference: Sutherland, Sproull and Schumacker 1974.
    """
    rays = rings[:, 1:] - rings[:, :1]
    return np.cross(rays[:, :-1], rays[:, 1:])


def _cut(ring: AnyArray) -> AnyArray:
    """Triangles `[n - 2, 3]` of one polygon `[n, 3]`, in the plane that fits it best."""
    try:
        from mapbox_earcut import triangulate_float64
    except ImportError as error:
        raise BackendUnavailableError(
            "a mesh with concave polygons needs mapbox-earcut: pip install 'vnca[texture]'"
        ) from error
    flat = _flattened(ring, _fan_normals(ring[None])[0].sum(0))
    # Without a plane there is no inside either: any triangles will do.
    if flat is None:
        return _fan(len(ring))
    cut = triangulate_float64(flat, np.array([len(ring)], np.uint32)).reshape(-1, 3).astype(int)
    if not len(cut):
        return _fan(len(ring))
    a, b, c = flat[cut].transpose(1, 2, 0)
    turned = (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])
    cut[turned] = cut[turned, ::-1]
    return np.concatenate([cut, _left_out(np.unique(cut), len(ring))])


def _left_out(used: AnyArray, count: int) -> AnyArray:
    """Triangles between the corners in use and those beside them that are not.

    Corners on a straight side are left out; in space, where the polygon is bent, they may stand
    out of it, and the polygons beside it have them.
    """
    found = [np.empty((0, 3), np.int64)]
    for before, after in zip(used, np.append(used[1:], used[0] + count), strict=True):
        chain = np.arange(before, after + 1) % count
        if len(chain) > 2:
            found.append(chain[_fan(len(chain))])
    return np.concatenate(found)


def _flattened(ring: AnyArray, normal: AnyArray) -> AnyArray | None:
    """`[n, 2]`, anticlockwise and at most a unit wide, if the polygon has a plane."""
    extent = np.ptp(ring, axis=0).max()
    length = np.linalg.norm(normal)
    if not (np.isfinite(extent) and np.isfinite(length) and length > 0):
        return None
    up = normal / length
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    return np.ascontiguousarray(
        (ring - ring[0]) / extent @ np.stack([right, np.cross(up, right)]).T
    )
