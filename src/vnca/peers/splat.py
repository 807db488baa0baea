"""Between particles and cells: splatting and gathering.

Positions are `[n, 3]` in cells, cell `[i, j, k]` centred on (i, j, k). Differentiable in the
values, and splatting of weights in the positions too.

Reference: Kim et al. 2020 (LNST); Monaghan 1992 (cubic spline).
"""

from itertools import product

import torch
from jaxtyping import Float, Int
from torch import Tensor

_LEAST_WEIGHT = 1e-6
_BESIDE = tuple(product((-1, 0, 1), repeat=3))


def cubic_spline(q: Tensor) -> Tensor:
    """The kernel W of smoothed particles, 1 at q = 0 over π⁻¹·8, and 0 from q = 1 on."""
    near = 6 * (q**3 - q**2) + 1
    far = 2 * (1 - q).clamp_min(0) ** 3
    return torch.where(q <= 0.5, near, far)


class Splatter:
    """Splats values of particles at fixed positions; what depends on these is computed once.

    Each particle reaches the 27 cells around it, as in the published code: a kernel wider than one
    and a half cells is cut off there.
    """

    def __init__(
        self,
        positions: Float[Tensor, "n 3"],
        shape: tuple[int, ...] | torch.Size,
        width: float,
        *,
        always_full: bool = False,
    ) -> None:
        """Prepare.

        Args:
            positions: In cells; those outside the grid reach none of it.
            shape: Cells of the grid.
            width: h, where the kernel ends, cells.
            always_full: A cell that a single particle touches has its value, as published: smoke
                then grows by a cell all around. Else it fades where there are less than half as
                many particles as cells.
        """
        self._shape = tuple(shape[:3])
        self._cells, self._weights = _reached(positions, self._shape, width)
        self._count = self._shape[0] * self._shape[1] * self._shape[2]
        total = positions.new_zeros(self._count + 1)
        for cells, weights in zip(self._cells, self._weights, strict=True):
            total = total.index_add(0, cells, weights)
        if always_full:
            self._total = torch.where(total > _LEAST_WEIGHT, total, 1)
        else:
            self._total = total.clamp_min(0.5 * _weight_of_one_a_cell(width))

    def __call__(self, values: Float[Tensor, " n"]) -> Float[Tensor, "x y z"]:
        """The weighted mean of the values around each cell; 0 where there are none."""
        found = values.new_zeros(self._count + 1)
        for cells, weights in zip(self._cells, self._weights, strict=True):
            found = found.index_add(0, cells, weights * values)
        return (found / self._total)[:-1].view(self._shape)


def splatted_mass(
    positions: Float[Tensor, "n 3"], shape: tuple[int, ...] | torch.Size, width: float
) -> Float[Tensor, "x y z"]:
    """Σ W of the particles around each cell, scaled to the number of particles in a cell.

    Differentiable in the positions.
    """
    size = tuple(shape[:3])
    mass = positions.new_zeros(size[0] * size[1] * size[2] + 1)
    for cells, weights in zip(*_reached(positions, size, width), strict=True):
        mass = mass.index_add(0, cells, weights)
    return mass[:-1].view(size) / _weight_of_one_a_cell(width)


def _weight_of_one_a_cell(width: float) -> float:
    """Σ W of particles on a lattice, one a cell."""
    distances = torch.tensor(_BESIDE, dtype=torch.float64).norm(dim=1)
    return float(cubic_spline(distances / width).sum())


def _reached(
    positions: Tensor, shape: tuple[int, ...], width: float
) -> tuple[list[Int[Tensor, " n"]], list[Float[Tensor, " n"]]]:
    """For each of the 27 neighbours: the flat cell of every particle, and its weight there.

    The cell beyond the last is for what lies outside.
    """
    size = torch.tensor(shape, device=positions.device)
    home = positions.detach().round().long()
    cells, weights = [], []
    for step in _BESIDE:
        cell = home + torch.tensor(step, device=positions.device)
        inside = ((cell >= 0) & (cell < size)).all(1)
        flat = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
        distance = (positions - cell).square().sum(1).clamp_min(1e-12).sqrt()
        cells.append(torch.where(inside, flat, shape[0] * shape[1] * shape[2]))
        weights.append(cubic_spline(distance / width) * inside)
    return cells, weights


def gathered(
    field: Float[Tensor, "x y z *c"], positions: Float[Tensor, "n 3"]
) -> Float[Tensor, "n ..."]:
    """Values at particles by Catmull–Rom splines along each axis; edges go on beyond."""
    base = positions.floor()
    part = positions - base
    weights = torch.stack(
        [
            0.5 * (-part + 2 * part**2 - part**3),
            0.5 * (2 - 5 * part**2 + 3 * part**3),
            0.5 * (part + 4 * part**2 - 3 * part**3),
            0.5 * (-(part**2) + part**3),
        ]
    )
    corner = base.long() - 1
    index = [
        [(corner[:, axis] + k).clamp(0, field.shape[axis] - 1) for k in range(4)]
        for axis in range(3)
    ]
    found = field.new_zeros(len(positions), *field.shape[3:])
    for i, j, k in product(range(4), repeat=3):
        weight = weights[i, :, 0] * weights[j, :, 1] * weights[k, :, 2]
        values = field[index[0][i], index[1][j], index[2][k]]
        found = found + weight.view(-1, *[1] * (field.ndim - 3)) * values
    return found
