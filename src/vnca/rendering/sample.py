"""Reading a dense field between its cell centres."""

from itertools import product

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional


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
