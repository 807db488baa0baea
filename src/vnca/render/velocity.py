"""The smoke's velocity as a camera sees it move."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from vnca.camera import Camera
from vnca.errors import ShapeError
from vnca.render.view import Mode, render
from vnca.typing import AnyArray


@torch.no_grad()
def projected_velocity(
    density: Float[Tensor, "x y z"],
    velocity: Float[Tensor, "x y z 3"],
    camera: Camera,
    *,
    rows: int,
    columns: int,
    gamma: float,
    step: float = 1.0,
    offset: float = 0.0,
    mode: Mode = "sane",
    cells_to_world: AnyArray | None = None,
) -> tuple[Float[Tensor, "rows columns 2"], Float[Tensor, "rows columns"]]:
    """What moves in each pixel of a view, and how opaque the pixel is.

    Each cell moves by some pixels in a frame. The camera sees these movements as it sees
    colours: the mean along a ray, weighted by how much every sample contributes to the picture.

    Args:
        density: max(d (1 + Δd), 0), non-negative.
        velocity: Cells per frame.
        camera: Where to look from, in the space that `cells_to_world` leads to.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        gamma: Extinction of density one, 1/length.
        step: Length between samples along a ray.
        offset: Shift of all samples along their rays, in steps.
        mode: Integrand, see `render`.
        cells_to_world: Where the camera is, see `render`.

    Returns:
        Pixels per frame, to the right and down, zero where nothing is seen; and the opacity.

    Raises:
        ShapeError: If density and velocity do not cover the same cells.
        OptionError: If an option is out of range.

    Reference: VNCA section 3.4, J^ψ.
    """
    if velocity.shape != (*density.shape, 3):
        raise ShapeError(
            "velocity to project: expected [x, y, z, 3] for a density of "
            f"{tuple(density.shape)}, got {tuple(velocity.shape)}"
        )
    smoke = torch.nonzero(density > 0)
    there = tuple(smoke.T)
    moved = density.new_zeros(*density.shape, 3)
    place = np.eye(4) if cells_to_world is None else cells_to_world
    moved[there] = _pixels(smoke, velocity[there], camera, rows, columns, place)
    view = render(
        density,
        moved,
        camera,
        rows=rows,
        columns=columns,
        gamma=gamma,
        step=step,
        offset=offset,
        mode=mode,
        cells_to_world=cells_to_world,
    )
    weight = view.colour[..., 2:]
    return view.colour[..., :2] / weight.clamp_min(1e-6), view.opacity


def _pixels(
    cells: Tensor,
    velocity: Tensor,
    camera: Camera,
    rows: int,
    columns: int,
    cells_to_world: AnyArray,
) -> Float[Tensor, "n 3"]:
    """How far cells move in the picture in a frame: right, down, and a one.

    A camera sees the one as the sum of the weights of a ray, which makes the others a mean.
    """
    start = cells.cpu().numpy().astype(np.float64)
    end = start + velocity.cpu().numpy()
    linear, translation = cells_to_world[:3, :3], cells_to_world[:3, 3]
    (row, column, _), (row_after, column_after, _) = (
        camera.project(points @ linear.T + translation, rows, columns) for points in (start, end)
    )
    moved = np.stack([column_after - column, row_after - row, np.ones(len(start))], axis=-1)
    # Behind a pinhole there is no picture.
    return torch.from_numpy(np.nan_to_num(moved)).to(velocity)
