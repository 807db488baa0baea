"""Carrying fields along a flow, and flows that have a potential.

Fields are tensors `[x, y, z]` or `[x, y, z, c]`, flows `[x, y, z, 3]` in cells. All is
differentiable in both.

Reference: Selle et al. 2008 (MacCormack advection with a limiter); Kim et al. 2019 (TNST), whose
stylisation is one step of it along ∇φ or ∇×ψ.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

AXES = (0, 1, 2)


def places(shape: tuple[int, ...] | torch.Size, like: Tensor) -> Float[Tensor, "x y z 3"]:
    """The index coordinates of every cell."""
    axes = [torch.arange(n, dtype=like.dtype, device=like.device) for n in shape[:3]]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1)


def sample(
    field: Float[Tensor, "x y z *c"], at: Float[Tensor, "i j k 3"], *, outside: str = "border"
) -> Float[Tensor, "i j k *c"]:
    """Values of a field between its cells, trilinearly.

    Args:
        field: At cell centres.
        at: Where, in cells.
        outside: What there is beyond the outermost cells: their values (`border`), or `zeros`.
    """
    flat = field.ndim == 3
    values = field[..., None] if flat else field
    size = at.new_tensor(values.shape[:3])
    # An axis of one cell has no coordinate that differs from its only one.
    scaled = 2 * at / (size - 1).clamp_min(1) - 1
    found = functional.grid_sample(
        values.permute(3, 0, 1, 2)[None],
        scaled.flip(-1)[None],
        align_corners=True,
        padding_mode=outside,
    )[0].permute(1, 2, 3, 0)
    return found[..., 0] if flat else found


def pulled(
    field: Float[Tensor, "x y z *c"], flow: Float[Tensor, "x y z 3"]
) -> Float[Tensor, "x y z *c"]:
    """What lies where the flow points to, x + v: a map that is linear in the field.

    Reference: Aurand et al. 2022, who transport with nothing else.
    """
    return sample(field, places(field.shape, flow) + flow)


def semi_lagrangian(
    field: Float[Tensor, "x y z *c"], flow: Float[Tensor, "x y z 3"]
) -> Float[Tensor, "x y z *c"]:
    """The field after a frame in the flow: at x is what was at x − v."""
    return pulled(field, -flow)


def maccormack(
    field: Float[Tensor, "x y z *c"],
    flow: Float[Tensor, "x y z 3"],
    *,
    limits_by_centre: bool = False,
) -> Float[Tensor, "x y z *c"]:
    """Semi-Lagrangian transport whose error of first order is taken back.

    Where the correction leaves the range of the eight values that were mixed, it is left out.

    Args:
        field: At cell centres.
        flow: Cells a frame.
        limits_by_centre: The range is that of the eight cells in the middle of the field, wherever
            a value came from: a slip of the published code of TNST and LNST, which takes
            coordinates from −1 to 1 for indices.
    """
    moved = semi_lagrangian(field, flow)
    back = semi_lagrangian(moved, -flow)
    corrected = moved + 0.5 * (field - back)
    with torch.no_grad():
        size = flow.new_tensor(field.shape[:3])
        came = places(field.shape, flow) - flow
        if limits_by_centre:
            came = (2 * came / (size - 1).clamp_min(1) - 1).trunc() + (size - 1) / 2
        corner = came.floor().long()
        x, y, z = (corner[..., axis].clamp(0, field.shape[axis] - 1) for axis in AXES)
        low, high = (_of_corners(field, pick)[x, y, z] for pick in (torch.minimum, torch.maximum))
    return torch.where((corrected < low) | (corrected > high), moved, corrected)


def _of_corners(field: Tensor, pick: Callable[[Tensor, Tensor], Tensor]) -> Tensor:
    """The least or greatest of the eight values that sampling above a cell mixes."""
    for axis in AXES:
        upper = torch.cat(
            [field.narrow(axis, 1, field.shape[axis] - 1), field.narrow(axis, -1, 1)], axis
        )
        field = pick(field, upper)
    return field


def gradient(potential: Float[Tensor, "x y z"]) -> Float[Tensor, "x y z 3"]:
    """∇φ by forward differences, the last of them twice."""
    return torch.stack([_difference(potential, axis) for axis in AXES], dim=-1)


def curl(potential: Float[Tensor, "x y z 3"]) -> Float[Tensor, "x y z 3"]:
    """∇×ψ by the same differences: its `divergence` is zero to rounding, at borders, too."""
    x, y, z = potential.unbind(-1)
    return torch.stack(
        [
            _difference(z, 1) - _difference(y, 2),
            _difference(x, 2) - _difference(z, 0),
            _difference(y, 0) - _difference(x, 1),
        ],
        dim=-1,
    )


def divergence(flow: Float[Tensor, "x y z 3"]) -> Float[Tensor, "x y z"]:
    """∇·v by the same differences."""
    return torch.stack([_difference(flow[..., axis], axis) for axis in AXES]).sum(0)


def _difference(field: Tensor, axis: int) -> Tensor:
    if field.shape[axis] == 1:
        return torch.zeros_like(field)
    forward = field.diff(dim=axis)
    return torch.cat([forward, forward.narrow(axis, -1, 1)], axis)


def resized(
    field: Float[Tensor, "x y z *c"], shape: tuple[int, int, int]
) -> Float[Tensor, "i j k *c"]:
    """The same field on a grid of other cells, as for octaves: averaged or interpolated."""
    if tuple(field.shape[:3]) == shape:
        return field
    size, target = (torch.tensor(n, dtype=field.dtype) for n in (field.shape[:3], shape))
    ratio = (size / target).to(field.device)
    if bool((ratio > 1).any()):
        # Without it, every second cell of a finer grid would be left out.
        field = blurred(field, 0.5 * (float(ratio.max()) ** 2 - 1) ** 0.5)
    return sample(field, (places(shape, field) + 0.5) * ratio - 0.5)


def blurred(field: Float[Tensor, "x y z *c"], sigma: float) -> Float[Tensor, "x y z *c"]:
    """A Gaussian of deviation `sigma` cells over it, cut at three; edges go on beyond."""
    if sigma <= 0:
        return field
    flat = field.ndim == 3
    values = (field[..., None] if flat else field).permute(3, 0, 1, 2)[:, None]
    reach = max(1, round(3 * sigma))
    offsets = torch.arange(-reach, reach + 1, dtype=field.dtype, device=field.device)
    kernel = torch.exp(-0.5 * (offsets / sigma) ** 2)
    kernel = kernel / kernel.sum()
    for axis in AXES:
        pad = [0] * 6
        pad[2 * (2 - axis)] = pad[2 * (2 - axis) + 1] = reach
        shape = [1, 1, 1, 1, 1]
        shape[2 + axis] = len(kernel)
        values = functional.conv3d(
            functional.pad(values, pad, mode="replicate"), kernel.view(shape)
        )
    found = values[:, 0].permute(1, 2, 3, 0)
    return found[..., 0] if flat else found
