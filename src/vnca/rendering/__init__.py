"""What a camera sees of smoke: on tensors, differentiable (`view.py`), or for films (`film.py`).

Here is what both have in common. It needs no torch, and neither do films where the native core is.
"""

import math
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.core.camera import WHOLE, Camera
from vnca.core.errors import OptionError, ShapeError

UNSEEN = 5e-4
"""What gets less light through than this is left out: an eighth of a step of 8-bit colour."""
THINNEST = 1e-12
"""Density this thin is invisible; below it nothing is divided by it."""
MOST_RAYS = 4
"""Along the rows and the columns of a pixel of a film."""
# Where the samples of a pixel begin, in steps: each finer grid fills the gaps of the one before.
_STAGGER = 0.618034


def check_view(
    density: tuple[int, ...],
    colour: tuple[int, ...],
    *,
    rows: int,
    columns: int,
    gamma: float,
    step: float,
) -> None:
    """Refuse what cannot be rendered.

    Args:
        density: Its shape.
        colour: Its shape.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        gamma: Extinction of density one, 1/length.
        step: Length between samples along a ray.

    Raises:
        ShapeError: If density and colour do not cover the same cells.
        OptionError: If an option is out of range.
    """
    if len(density) != 3 or colour != (*density, 3):
        raise ShapeError(
            "volume to render: expected density [x, y, z] and colour [x, y, z, 3], "
            f"got {density} and {colour}"
        )
    if min(rows, columns) < 1:
        raise OptionError(f"picture size: expected at least 1×1 pixels, got {columns}×{rows}")
    if not gamma >= 0:
        raise OptionError(f"gamma: expected 0 or more, got {gamma}")
    if not step > 0:
        raise OptionError(f"step: expected more than 0, got {step}")


def rays_in_cells(
    camera: Camera, rows: int, columns: int, cells_to_world: AnyArray | None, band: slice = WHOLE
) -> tuple[AnyArray, AnyArray]:
    """Rays `point = origin + depth · direction` through the middles of pixels, in cells.

    Args:
        camera: Where to look from, in the space that `cells_to_world` leads to.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        cells_to_world: 4×4, affine and invertible; the same unless given.
        band: Through which rows of pixels; all unless given.

    Returns:
        Origins and directions `[rays, 3]`, row by row; depths are those of the camera's space.
    """
    origins, directions = (array.reshape(-1, 3) for array in camera.rays(rows, columns, band))
    if cells_to_world is None:
        return origins, directions
    to_cells = np.linalg.inv(cells_to_world[:3, :3])
    return (origins - cells_to_world[:3, 3]) @ to_cells.T, directions @ to_cells.T


def moved_cells(
    cells: AnyArray,
    velocity: AnyArray,
    cameras: tuple[Camera, Camera],
    rows: int,
    columns: int,
    cells_to_world: AnyArray | None,
) -> AnyArray:
    """How far cells move in a picture until the next frame.

    Args:
        cells: `[n, 3]`, cell coordinates.
        velocity: `[n, 3]`, cells per frame.
        cameras: Where they are seen from, in the space that `cells_to_world` leads to; and from
            where a frame later.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        cells_to_world: 4×4, affine; the same space unless given.

    Returns:
        `[n, 2]`, pixels to the right and down; zero where a camera does not see the cell before it.
    """
    place = np.eye(4) if cells_to_world is None else cells_to_world
    start = cells.astype(np.float64)
    (row, column, _), (row_after, column_after, _) = (
        camera.project(points @ place[:3, :3].T + place[:3, 3], rows, columns)
        for camera, points in zip(cameras, (start, start + velocity), strict=True)
    )
    # Behind a pinhole there is no picture.
    return np.nan_to_num(np.stack([column_after - column, row_after - row], axis=-1))


def rays_along(pixel: float) -> int:
    """Rays along the side of a pixel so many cells wide, for what is finer not to flicker.

    None is further from the next than a cell, unless that takes more than `MOST_RAYS`.
    """
    return min(MOST_RAYS, max(1, math.ceil(pixel - 1e-6)))


def staggered(offset: float, along: int, rows: int, columns: int) -> AnyArray:
    """Where the samples of `along` × `along` rays of each pixel begin, in steps, row by row."""
    of_pixel = (offset + _STAGGER * np.arange(along**2)).reshape(along, along) % 1
    return np.tile(of_pixel, (rows, columns)).ravel()


def averaged(values: Any, rows: int, columns: int, along: int) -> Any:
    """Means over `along` × `along` rays of each pixel, `[rows, columns, …]`.

    Args:
        values: An array or tensor `[rays, …]`.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        along: Rays along the rows and the columns of a pixel.
    """
    shape = (rows, along, columns, along, *values.shape[1:])
    return values.reshape(shape).mean((1, 3))
