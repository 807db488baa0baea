"""Where along each ray there is smoke to sample.

Everything here is about positions only, so nothing is differentiated.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

# Candidate samples looked at together. It bounds the memory of large pictures, and a few tens of
# megabytes are reused from the allocator where hundreds are mapped and cleared each time anew.
SAMPLES_AT_ONCE = 1 << 20


@dataclass(frozen=True, eq=False)
class Samples:
    """Sample positions on the rays that meet smoke.

    A table with a row for each such ray holds them packed to the front, near to far; the rest
    of a row stays empty.

    Attributes:
        points: `[n, 3]`, cell coordinates of the samples.
        row: `[n]`, row of each sample in the table.
        column: `[n]`, its column.
        depth: `[rows, columns]`, the depths as such a table; zero where it is empty.
        ray: `[rows]`, which of the rays marched each row is.
    """

    points: Tensor
    row: Tensor
    column: Tensor
    depth: Tensor
    ray: Tensor

    def table(self, values: Tensor) -> Tensor:
        """Values at the points, `[n, c]`, as `[rows, columns, c]`. Differentiable."""
        empty = values.new_zeros(*self.depth.shape, values.shape[1])
        return empty.index_put((self.row, self.column), values)


@torch.no_grad()
def march(
    density: Tensor,
    origins: Tensor,
    directions: Tensor,
    *,
    near: float,
    step: float,
    offset: float | Tensor,
) -> Iterator[Samples]:
    """Find the samples with smoke within a cell of them, for a group of rays at a time.

    Samples lie at depths (k + offset) · step for whole k, wherever the smoke begins: what is
    skipped never moves what is kept. Leaving out samples of zero density changes nothing, as
    they neither absorb nor emit; so those that are left are packed to the front of their ray.

    Args:
        density: `[x, y, z]`.
        origins: `[rays, 3]`, cell coordinates.
        directions: `[rays, 3]`, cells for each length of depth, of any length.
        near: Depth before which nothing is sampled.
        step: Depth between samples.
        offset: Where the samples begin, in steps, in [0, 1); of all rays, or `[rays]` of each.
    """
    smoke = density > 0
    if not smoke.any():
        return
    lower, upper = _bounds(smoke)
    enter, leave = _cross_box(origins, directions, lower - 1, upper + 1, near)
    first = torch.ceil(enter / step - offset)
    count = (torch.floor(leave / step - offset) - first + 1).nan_to_num(0).clamp_min(0)
    hit = torch.nonzero(count > 0)[:, 0]
    if not len(hit):
        return
    longest = int(count.max())
    reach = _reach(smoke)
    for rays in hit.split(max(1, SAMPLES_AT_ONCE // longest)):
        origin, direction = origins[rays, None], directions[rays, None]
        k = first[rays, None] + torch.arange(longest, device=density.device)
        depth = (k + (offset[rays, None] if isinstance(offset, Tensor) else offset)) * step
        points = torch.addcmul(origin, depth[..., None], direction)
        inside = k < (first + count)[rays, None]
        row, column = torch.nonzero(inside & _look_up(reach, points), as_tuple=True)
        if len(row):
            yield _pack(points[row, column], depth[row, column], row, rays)


def _pack(points: Tensor, depth: Tensor, ray: Tensor, rays: Tensor) -> Samples:
    """Sort samples, given in order of ray and depth, into a table without empty rows."""
    met, row, count = torch.unique_consecutive(ray, return_inverse=True, return_counts=True)
    starts = torch.cumsum(count, 0) - count
    column = torch.arange(len(row), device=row.device) - starts[row]
    table = depth.new_zeros(len(met), int(count.max()))
    table[row, column] = depth
    return Samples(points, row, column, table, rays[met])


def _bounds(smoke: Tensor) -> tuple[Tensor, Tensor]:
    """Least and greatest cell with smoke, as points."""
    ends = []
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        cells = torch.nonzero(smoke.sum(others))
        ends.append((cells[0], cells[-1]))
    lower, upper = (torch.cat(end) for end in zip(*ends, strict=True))
    return lower, upper


def _cross_box(
    origins: Tensor, directions: Tensor, lower: Tensor, upper: Tensor, near: float
) -> tuple[Tensor, Tensor]:
    """Depths at which rays enter and leave a box; enter > leave where they miss it."""
    # Parallel to a face: the division gives ±inf, and NaN on the face itself, where the
    # smoke has faded to nothing.
    a, b = (lower - origins) / directions, (upper - origins) / directions
    enter = torch.minimum(a, b).amax(-1).clamp_min(near)
    leave = torch.maximum(a, b).amin(-1)
    return enter, leave


def _reach(smoke: Tensor) -> Tensor:
    """Whether interpolation between 2×2×2 cells meets smoke: `[x + 1, y + 1, z + 1]`.

    Entry `[i, j, k]` stands for the points from (i − 1, j − 1, k − 1) to (i, j, k).
    """
    padded = functional.pad(smoke.float(), (1, 1, 1, 1, 1, 1))
    return functional.max_pool3d(padded[None, None], 2, stride=1)[0, 0] > 0


def _look_up(reach: Tensor, points: Tensor) -> Tensor:
    x, y, z = (
        (points[..., axis].floor().long() + 1).clamp_(0, reach.shape[axis] - 1) for axis in range(3)
    )
    flat = (x * reach.shape[1] + y) * reach.shape[2] + z
    return reach.view(-1)[flat]
