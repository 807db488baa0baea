"""Which pixels a triangle covers: whole meshes at once, in numpy.

Pixel `[row, column]` has its centre at the point (column, row).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, IntArray
from vnca.core.camera import Camera

_BATCH = 1 << 20  # pixels at once


class Fragments(NamedTuple):
    """Pixels whose centres triangles cover; a pixel comes once for each triangle over it."""

    triangle: AnyArray
    row: AnyArray
    column: AnyArray


class Visible(NamedTuple):
    """What is seen of a mesh in each pixel.

    Attributes:
        triangle: `[r, c]`, the nearest, −1 where there is none.
        weights: `[r, c, 3]`, of its corners.
    """

    triangle: IntArray
    weights: AnyArray

    @property
    def covered(self) -> AnyArray:
        """`[r, c]`, whether there is a triangle."""
        return self.triangle >= 0

    def interpolate(self, values: AnyArray, faces: AnyArray) -> AnyArray:
        """Values at the covered pixels `[n, k]` from values at the corners `[v, k]`."""
        corners = values[faces[self.triangle[self.covered]]]
        return np.einsum("nkc,nk->nc", corners, self.weights[self.covered])


def fragments(corners: AnyArray, rows: int, columns: int) -> Iterator[Fragments]:
    """The pixels of a picture that triangles cover, in batches, in the order of the triangles.

    Row by row: where the row crosses the edges of a triangle, everything between is inside. So
    the work is that of the pixels covered, also for long and thin triangles.

    Args:
        corners: `[t, 3, 2]`, points (column, row).
        rows: Height of the picture.
        columns: Width of the picture.
    """
    top, bottom = _whole(corners[..., 1].min(1), corners[..., 1].max(1), rows)
    for triangle, row in _expanded(top, bottom):
        a = corners[triangle]
        b = np.roll(a, -1, axis=1)
        height = b[..., 1] - a[..., 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            part = (row[:, None] - a[..., 1]) / height
            # An edge along the row has no crossing of its own: its ends are those of others.
            crosses = (height != 0) & (part >= 0) & (part <= 1)
            at = a[..., 0] + part * (b[..., 0] - a[..., 0])
        left = np.where(crosses, at, np.inf).min(1)
        right = np.where(crosses, at, -np.inf).max(1)
        first, last = _whole(left, right, columns)
        for span, column in _expanded(first, last):
            yield Fragments(triangle[span], row[span], column)


def weights_at(corners: AnyArray, columns: AnyArray, rows: AnyArray) -> AnyArray:
    """Weights `[n, 3]` of the corners `[n, 3, 2]` at points; beyond 0 and 1 outside.

    They add up to one. A triangle without area has all its weight on its first corner.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    point = np.stack([columns, rows], -1)
    area = _cross(b - a, c - a)
    safe = np.where(area == 0, 1, area)
    second = np.where(area == 0, 0, _cross(point - a, c - a) / safe)
    third = np.where(area == 0, 0, _cross(b - a, point - a) / safe)
    return np.stack([1 - second - third, second, third], -1)


def visible(
    points: AnyArray, faces: AnyArray, camera: Camera, *, rows: int, columns: int
) -> Visible:
    """The nearest triangle in each pixel of a picture.

    Args:
        points: `[v, 3]`, in the coordinates of the camera, which should be orthographic.
        faces: `[f, 3]`.
        camera: Where to look from.
        rows: Height of the picture.
        columns: Width of the picture.
    """
    row, column, depth = camera.project(points, rows, columns)
    corners, depths = np.stack([column, row], -1)[faces], depth[faces]
    nearest = np.full(rows * columns, np.inf)
    triangle = np.full(rows * columns, -1, np.int32)
    weights = np.zeros((rows * columns, 3))
    for part in fragments(corners, rows, columns):
        share = weights_at(corners[part.triangle], part.column, part.row)
        far = (share * depths[part.triangle]).sum(1)
        pixel = part.row * columns + part.column
        order = np.lexsort((far, pixel))
        first = order[np.unique(pixel[order], return_index=True)[1]]
        first = first[far[first] < nearest[pixel[first]]]
        nearest[pixel[first]] = far[first]
        triangle[pixel[first]] = part.triangle[first]
        weights[pixel[first]] = share[first]
    return Visible(triangle.reshape(rows, columns), weights.reshape(rows, columns, 3))


def _whole(low: AnyArray, high: AnyArray, size: int) -> tuple[AnyArray, AnyArray]:
    """First and last whole number in intervals, within 0 to size − 1; last < first if none."""
    first = np.clip(np.ceil(low), 0, size).astype(np.int64)
    last = np.clip(np.floor(high), -1, size - 1).astype(np.int64)
    return first, last


def _expanded(first: AnyArray, last: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Every interval's index with each whole number in it, a batch at a time."""
    counts = np.maximum(last - first + 1, 0)
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        before = ends[start] - counts[start]
        stop = max(start + 1, int(np.searchsorted(ends, before + _BATCH, side="right")))
        part = counts[start:stop]
        index = np.repeat(np.arange(start, stop), part)
        if len(index):
            within = np.arange(len(index)) - np.repeat(ends[start:stop] - part - before, part)
            yield index, first[index] + within
        start = stop


def _cross(a: AnyArray, b: AnyArray) -> AnyArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
