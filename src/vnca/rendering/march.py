"""Along the rays: where there is smoke to sample, its samples, and the light they add up to.

Emission and absorption, or the integrand as the VNCA paper prints it, for comparison with its
figures. Positions are not differentiated; values and what is gathered from them are.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.core.errors import ShapeError
from vnca.rendering import THINNEST, UNSEEN

# Candidate samples looked at together. It bounds the memory of large pictures, and a few tens of
# megabytes are reused from the allocator where hundreds are mapped and cleared each time anew.
SAMPLES_AT_ONCE = 1 << 20


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples on the rays that meet smoke, as far as they can be seen.

    A table with a row for each such ray holds them packed to the front, near to far; the rest
    of a row stays empty.

    Attributes:
        points: `[n, 3]`, cell coordinates of the samples.
        density: `[n]`, interpolated.
        ray: `[rows]`, which of the rays marched each row is.
        row: `[n]`, row of each sample in the table.
        column: `[n]`, its column.
        depth: `[rows, columns]`, the depths as such a table; zero where it is empty.
    """

    points: Tensor
    density: Tensor
    ray: Tensor
    row: Tensor
    column: Tensor
    depth: Tensor

    def light(
        self, density: Tensor, colour: Tensor, *, extinction: float, paper: bool
    ) -> tuple[Tensor, Tensor, Tensor]:
        """What comes along the rays. Differentiable in density and colour.

        Args:
            density: `[n]`, painted.
            colour: `[n, 3]`, linear RGB.
            extinction: Of density one, in a step.
            paper: Whether light adds up as the VNCA paper prints it.

        Returns:
            Premultiplied linear RGB `[rows, 3]`, the share of the light from behind that passes
            `[rows]`, and the mean depth of what is seen `[rows]`, infinite where that is nothing.
        """
        table = self._table(torch.cat([density[:, None], colour], -1))
        if paper:
            weights, passes = paper_weights(table[..., 0], gamma=extinction)
        else:
            weights, passes = ray_weights(table[..., 0], step=extinction)
        total = weights.sum(1)
        depth = (weights * self.depth).sum(1) / total.clamp_min(THINNEST)
        depth = torch.where(total > THINNEST, depth, math.inf)
        return gather(weights, table[..., 1:]), passes, depth

    def seen(self, extinction: float) -> "Samples":
        """Without what is hidden, if density one takes at least so much in a step.

        Nor with what is on the very border of the smoke, or by rounding beyond it.
        """
        least = self._table(self.density[:, None])[..., 0] * extinction
        reached = running_sum(least) - least
        seen = (reached < -math.log(UNSEEN))[self.row, self.column] & (self.density > 0)
        some = (self.points[seen], self.density[seen], self.ray, self.row[seen], self.column[seen])
        return Samples(*some, self.depth)

    def _table(self, values: Tensor) -> Tensor:
        """Values at the points, `[n, c]`, as `[rows, columns, c]`. Differentiable."""
        empty = values.new_zeros(*self.depth.shape, values.shape[1])
        return empty.index_put((self.row, self.column), values)


@torch.no_grad()
def samples_along(
    density: Tensor,
    origins: Tensor,
    directions: Tensor,
    *,
    near: float,
    step: float,
    offset: float | Tensor,
    extinction: float,
) -> Iterator[Samples]:
    """Find the samples in smoke, for a group of rays at a time.

    Samples lie at depths (k + offset) · step for whole k, wherever the smoke begins: what is
    skipped never moves what is kept. Leaving out samples of zero density changes nothing, as
    they neither absorb nor emit; so those that are left are packed to the front of their ray. Nor
    are there those that so much smoke hides that they could not be seen.

    Args:
        density: `[x, y, z]`.
        origins: `[rays, 3]`, cell coordinates.
        directions: `[rays, 3]`, cells for each length of depth, of any length.
        near: Depth before which nothing is sampled.
        step: Depth between samples.
        offset: Where the samples begin, in steps, in [0, 1); of all rays, or `[rays]` of each.
        extinction: Of density one, in a step: the least that it can be.
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
    near_smoke = _near_smoke(smoke)
    for rays in hit.split(max(1, SAMPLES_AT_ONCE // longest)):
        origin, direction = origins[rays, None], directions[rays, None]
        k = first[rays, None] + torch.arange(longest, device=density.device)
        depth = (k + (offset[rays, None] if isinstance(offset, Tensor) else offset)) * step
        points = torch.addcmul(origin, depth[..., None], direction)
        inside = k < (first + count)[rays, None]
        row, column = torch.nonzero(inside & _look_up(near_smoke, points), as_tuple=True)
        if len(row):
            points, depth = points[row, column], depth[row, column]
            here = sample(density[..., None], points)[:, 0]
            yield _pack(points, here, depth, row, rays).seen(extinction)


def _pack(points: Tensor, density: Tensor, depth: Tensor, ray: Tensor, rays: Tensor) -> Samples:
    """Sort samples, given in order of ray and depth, into a table without empty rows."""
    met, row, count = torch.unique_consecutive(ray, return_inverse=True, return_counts=True)
    starts = torch.cumsum(count, 0) - count
    column = torch.arange(len(row), device=row.device) - starts[row]
    table = depth.new_zeros(len(met), int(count.max()))
    table[row, column] = depth
    return Samples(points, density, rays[met], row, column, table)


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


def _near_smoke(smoke: Tensor) -> Tensor:
    """Whether interpolation between 2×2×2 cells meets smoke: `[x + 1, y + 1, z + 1]`.

    Entry `[i, j, k]` stands for the points from (i − 1, j − 1, k − 1) to (i, j, k).
    """
    padded = functional.pad(smoke.float(), (1, 1, 1, 1, 1, 1))
    return functional.max_pool3d(padded[None, None], 2, stride=1)[0, 0] > 0


def _look_up(near_smoke: Tensor, points: Tensor) -> Tensor:
    x, y, z = (
        (points[..., axis].floor().long() + 1).clamp_(0, near_smoke.shape[axis] - 1)
        for axis in range(3)
    )
    flat = (x * near_smoke.shape[1] + y) * near_smoke.shape[2] + z
    return near_smoke.view(-1)[flat]


def sample(field: Float[Tensor, "x y z c"], points: Float[Tensor, "n 3"]) -> Float[Tensor, "n c"]:
    """Trilinear interpolation at points in cell coordinates.

    Differentiable in `field`. The field is zero outside its array, to which it fades over
    the last cell.

    Args:
        field: Values at cell centres; cell `[i, j, k]` is the point (i, j, k).
        points: Cell coordinates (x, y, z), of the field's dtype.
    """
    # On CUDA the gradient of grid_sample adds up in any order, so that no two runs are equal.
    return _by_corners(field, points) if field.is_cuda else _by_grid_sample(field, points)


def _by_grid_sample(field: Tensor, points: Tensor) -> Tensor:
    # grid_sample puts -1 and 1 on the outer faces of the border cells and wants (z, y, x).
    size = points.new_tensor(field.shape[:3])
    where = ((2 * points + 1) / size - 1).flip(-1)
    values = functional.grid_sample(
        field.permute(3, 0, 1, 2)[None],
        where[None, None, None],
        mode="bilinear",
        padding_mode="zeros",
        align_corners=False,
    )
    return values[0, :, 0, 0].T


def _by_corners(field: Tensor, points: Tensor) -> Tensor:
    lower = points.floor()
    part = points - lower
    size = torch.tensor(field.shape[:3], device=field.device)
    cells = field.reshape(-1, field.shape[3])
    values = cells.new_zeros(len(points), cells.shape[1])
    for corner in product((0, 1), repeat=3):
        step = torch.tensor(corner, device=field.device)
        at = lower.long() + step
        weight = torch.where(step.bool(), part, 1 - part).prod(-1)
        weight = weight * ((at >= 0) & (at < size)).all(-1)
        x, y, z = torch.minimum(at.clamp_min(0), size - 1).unbind(-1)
        values = values + weight[:, None] * cells.index_select(0, (x * size[1] + y) * size[2] + z)
    return values


def ray_weights(
    extinction: Float[Tensor, "rays samples"], *, step: float
) -> tuple[Float[Tensor, "rays samples"], Float[Tensor, " rays"]]:
    """How much each sample contributes to its ray, and what is left at the end of it.

    Differentiable in `extinction`. The weights of a ray and its final transmittance add up
    to one.

    Args:
        extinction: σ, 1/cell, non-negative, near to far.
        step: Sample spacing, cells.

    Returns:
        Weights T_k α_k, and the transmittance behind the last sample.

    Reference: Max 1995, eq. 6; derivation in this folder's README.
    """
    thickness = extinction * step
    reached = running_sum(thickness)
    weights = torch.exp(thickness - reached) * -torch.expm1(-thickness)
    return weights, torch.exp(-thickness.sum(dim=1))


def running_sum(values: Float[Tensor, "rays samples"]) -> Float[Tensor, "rays samples"]:
    """The sum of the samples of each ray up to each of them, itself included. Differentiable."""
    if not values.is_cuda:
        return torch.cumsum(values, dim=1)
    # On CUDA cumsum adds up in any order: torch 2.8 refuses it where runs are to be equal.
    every = values.new_ones(values.shape[1], values.shape[1])
    return values @ every.triu()


def composite(
    extinction: Float[Tensor, "rays samples"],
    colour: Float[Tensor, "rays samples 3"],
    *,
    step: float,
) -> tuple[Float[Tensor, "rays 3"], Float[Tensor, " rays"]]:
    """Emission–absorption colour and opacity along each ray, near to far.

    Differentiable in `extinction` and `colour`.

    Args:
        extinction: σ, 1/cell, non-negative.
        colour: Linear RGB.
        step: Sample spacing, cells.

    Returns:
        Premultiplied linear RGB, and opacity in [0, 1].

    Raises:
        ShapeError: If the sample counts differ.

    Reference: Max 1995, eq. 6; derivation in this folder's README.
    """
    check_samples(extinction, colour)
    weights, transmittance = ray_weights(extinction, step=step)
    return gather(weights, colour), 1 - transmittance


def gather(
    weights: Float[Tensor, "rays samples"], colour: Float[Tensor, "rays samples c"]
) -> Float[Tensor, "rays c"]:
    """The weighted sum of the samples of each ray. Differentiable in both."""
    return torch.einsum("rs,rsc->rc", weights, colour)


def check_samples(extinction: Tensor, colour: Tensor) -> None:
    """Raise `ShapeError` unless there is one RGB colour for every sample."""
    if colour.shape != (*extinction.shape, 3):
        raise ShapeError(
            f"colour along rays: expected {(*extinction.shape, 3)} to match the extinction, "
            f"got {tuple(colour.shape)}"
        )


def paper_weights(
    density: Float[Tensor, "rays samples"], *, gamma: float
) -> tuple[Float[Tensor, "rays samples"], Float[Tensor, " rays"]]:
    """The paper's weights d_k τ_k, and the transmittance behind the last sample.

    Differentiable in `density`. τ_k counts the absorption of sample k itself, and the
    emission d_k does not scale with γ; so the weights of a ray tend to 1/γ, not to its
    opacity, and they depend on the spacing of the samples, which is one cell.

    Args:
        density: max(d (1 + Δd), 0), near to far, one sample a cell.
        gamma: Absorption of one cell of density one.
    """
    transmittance = torch.exp(-gamma * running_sum(density))
    return density * transmittance, torch.exp(-gamma * density.sum(dim=1))


def paper_composite(
    density: Float[Tensor, "rays samples"],
    colour: Float[Tensor, "rays samples 3"],
    *,
    gamma: float,
) -> tuple[Float[Tensor, "rays 3"], Float[Tensor, " rays"]]:
    """The paper's pixel colour, and one minus the final transmittance as opacity.

    Differentiable in `density` and `colour`.

    Args:
        density: max(d (1 + Δd), 0), near to far, one sample a cell.
        colour: Linear RGB.
        gamma: Absorption of one cell of density one.

    Raises:
        ShapeError: If the sample counts differ.

    Reference: VNCA, the equation for P; this folder's README lists what differs from
    `composite`.
    """
    check_samples(density, colour)
    weights, transmittance = paper_weights(density, gamma=gamma)
    return gather(weights, colour), 1 - transmittance
