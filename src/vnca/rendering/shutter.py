"""Motion blur: how what a picture shows moves across it by the next frame, and what that smears.

Each cell moves from where the camera sees it now to where it sees it a frame later; what a pixel
shows moves by the mean of these along its ray, weighted as colours are. The picture is then
averaged along that way, premultiplied, for as long as the shutter is open, half before and half
after the frame.

Reference: Potmesil and Chakravarty 1983, "Modeling motion blur in computer-generated images".
"""

import math

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Camera
from vnca.engine import native
from vnca.engine.native.marching import smeared as natively_smeared
from vnca.rendering import moved_cells
from vnca.rendering.film import Picture, render

COARSER = 4
"""So many pixels of a picture are one of its motion, which changes more slowly than colours."""
STILL = 0.05
"""Pixels: what moves by less while the shutter is open stays as it is."""
MOST = 129
"""Places, at most, whose mean a pixel is."""
_FAINT = 1e-3
# Farther than a picture is wide nothing needs to be followed.
_FARTHEST = 1.0


def screen_motion(
    density: FloatArray,
    velocity: FloatArray,
    cameras: tuple[Camera, Camera],
    cells_to_world: AnyArray | None = None,
) -> FloatArray:
    """How far smoke moves in a picture until the next frame.

    Args:
        density: `[x, y, z]`.
        velocity: `[x, y, z, 3]` at cell centres, cells per frame.
        cameras: Where it is seen from, in the space that `cells_to_world` leads to; and from where
            a frame later.
        cells_to_world: 4×4, affine; the same space unless given.

    Returns:
        `[x, y, z, 3]`, to the right, down, and zero, in heights of the picture; zero where there is
        no smoke, or a camera does not see the cell before it.
    """
    moved = np.zeros(velocity.shape, np.float32)
    smoke = np.nonzero(density > 0)
    moves = moved_cells(np.stack(smoke, axis=-1), velocity[smoke], cameras, 1, 1, cells_to_world)
    moved[(*smoke, slice(2))] = np.clip(moves, -_FARTHEST, _FARTHEST)
    return moved


def blurred(
    picture: Picture,
    density: FloatArray,
    velocity: FloatArray,
    camera: Camera,
    later: Camera,
    *,
    shutter: float,
    gamma: float,
    step: float = 1.0,
    cells_to_world: AnyArray | None = None,
    device: str = "cpu",
) -> Picture:
    """A picture as a shutter shows it that is open for a part of a frame.

    Args:
        picture: What is seen in an instant.
        density: `[x, y, z]`, what the picture shows.
        velocity: `[x, y, z, 3]` at cell centres, cells per frame.
        camera: Where the picture is taken from.
        later: From where the next one is.
        shutter: Part of a frame.
        gamma: Extinction of density one, 1/length.
        step: Length between samples along a ray.
        cells_to_world: 4×4, affine and invertible, from cells to where the cameras are.
        device: Where to render the motion: `cpu`, or as torch names it.
    """
    rows, columns = picture.opacity.shape
    coarse = max(1, rows // COARSER)
    moving = render(
        density,
        screen_motion(density, velocity, (camera, later), cells_to_world),
        camera,
        rows=coarse,
        columns=max(1, round(coarse * columns / rows)),
        gamma=gamma,
        step=step,
        cells_to_world=cells_to_world,
        device=device,
    )
    way = _at_pixels(_spread(moving, shutter), rows, columns) * np.float32(shutter * rows)
    longest = float(np.sqrt((way**2).sum(-1).max()))
    if longest < STILL:
        return picture
    count = min(2 * math.ceil(longest / 2) + 1, MOST)
    smear = smeared if native.unavailable() else natively_smeared
    seen = smear(np.ascontiguousarray(picture.rgba, np.float32), way, count, STILL)
    return Picture(seen[..., :3], seen[..., 3])


def smeared(picture: FloatArray, way: FloatArray, count: int, still: float) -> FloatArray:
    """Means of a picture along ways through its pixels; the picture ends as at its border.

    Args:
        picture: `[rows, columns, c]`.
        way: `[rows, columns, 2]`, pixels down and to the right, in the middle of which a pixel is.
        count: Of evenly spaced places on a way whose mean is taken; interpolated linearly.
        still: Pixels with a shorter way stay as they are.
    """
    result = picture.copy()
    moves = np.nonzero((way**2).sum(-1) >= still**2)
    at = np.stack(moves, axis=-1).astype(np.float32)
    total = np.zeros((len(at), picture.shape[-1]), np.float32)
    for k in range(count):
        time = np.float32((k + 0.5) / count - 0.5)
        total += interpolated(picture, at + time * way[moves])
    result[moves] = total / count
    return result


def interpolated(picture: FloatArray, places: FloatArray) -> FloatArray:
    """Values `[n, c]` between pixels, interpolated linearly; beyond the border those at it.

    Args:
        picture: `[rows, columns, c]`.
        places: `[n, 2]`, row and column, whole at pixel centres.
    """
    last = np.array(picture.shape[:2], np.float32) - 1
    places = np.clip(places, 0, last)
    low = np.minimum(np.floor(places), np.maximum(last - 1, 0)).astype(np.int64)
    (row, column), (below, beside) = low.T, np.minimum(low + 1, last).astype(np.int64).T
    down, right = (places - low).astype(np.float32).T[..., None]
    upper = picture[row, column] * (1 - right) + picture[row, beside] * right
    lower = picture[below, column] * (1 - right) + picture[below, beside] * right
    return upper * (1 - down) + lower * down


def _spread(moving: Picture, shutter: float) -> FloatArray:
    """The motion of pixels `[rows, columns, 2]`, down and to the right.

    Around smoke it is that of the smoke that may reach them.
    """
    motion, opacity = moving.colour[..., 1::-1], moving.opacity[..., None]
    longest = np.sqrt((motion**2).sum(-1) / np.maximum(moving.opacity, _FAINT) ** 2).max()
    reach = math.ceil(0.5 * shutter * float(longest) * len(motion)) + 1
    motion = motion + _FAINT * _boxed(motion, reach)
    opacity = opacity + _FAINT * _boxed(opacity, reach)
    return np.divide(motion, opacity, out=np.zeros_like(motion), where=opacity > _FAINT**3)


def _boxed(values: FloatArray, reach: int) -> FloatArray:
    """Means over squares of `2 · reach + 1` pixels a side, nothing beyond the border."""
    for axis in (0, 1):
        size = values.shape[axis]
        sums = np.cumsum(values, axis=axis, dtype=np.float64)
        sums = np.concatenate([np.zeros_like(np.take(sums, [0], axis)), sums], axis=axis)
        first = np.maximum(np.arange(size) - reach, 0)
        end = np.minimum(np.arange(size) + reach + 1, size)
        values = np.take(sums, end, axis) - np.take(sums, first, axis)
    return (values / (2 * reach + 1) ** 2).astype(np.float32)


def _at_pixels(motion: FloatArray, rows: int, columns: int) -> FloatArray:
    """A coarse picture, as high as a fine one of so many pixels, at the pixels of that one."""
    coarse_rows, coarse_columns = motion.shape[:2]
    scale = coarse_rows / rows
    row = (np.arange(rows) + 0.5) * scale - 0.5
    column = (np.arange(columns) + 0.5 - columns / 2) * scale + coarse_columns / 2 - 0.5
    places = np.stack(np.meshgrid(row, column, indexing="ij"), axis=-1).astype(np.float32)
    return interpolated(motion, places.reshape(-1, 2)).reshape(rows, columns, 2)
