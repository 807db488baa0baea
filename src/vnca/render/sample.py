"""Reading a dense field between its cell centres."""

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
