"""Velocity as files have it, made into cells per frame at cell centres in and near the smoke."""

from itertools import product
from typing import Any, Literal, TypeAlias

import numpy as np

from vnca.errors import BackendUnavailableError, GridError, OptionError
from vnca.typing import AnyArray, BoolArray, Box, FloatArray
from vnca.volume import Volume

VelocityUnits: TypeAlias = Literal["cells/frame", "m/s", "mantaflow"]
UNITS: tuple[VelocityUnits, ...] = ("cells/frame", "m/s", "mantaflow")

# Blender's fluid solver steps in tenths of its unit of time at 25 frames a second.
_MANTAFLOW_STEP, _MANTAFLOW_FPS = 0.1, 25.0

_FIT_MOST = 4.0
_FIT_LAYERS = 6
# As fractions of the greatest density: what counts as a change, and as a large residual.
_FIT_CHANGE, _FIT_TOLERANCE = 0.05, 0.1


def centred(
    velocity: FloatArray,
    stored: BoolArray,
    staggered: tuple[bool, bool, bool] = (True, True, True),
) -> FloatArray:
    """Velocity on lower faces, averaged to cell centres.

    Component `a` of cell `i` lies on the face towards `i - 1` along axis `a`; the face on the
    other side belongs to the next cell. Where that one is not stored, the lower face alone counts.

    Args:
        velocity: `[x, y, z, 3]`, with one layer of cells more than is wanted at each upper end.
        stored: `[x, y, z]`, which cells have a velocity.
        staggered: Which components lie on faces; the others are at centres already.

    Returns:
        `[x - 1, y - 1, z - 1, 3]`, zero where nothing is stored.
    """
    x, y, z = (cells - 1 for cells in stored.shape)
    result = np.zeros((x, y, z, 3), np.float32)
    # Smoke fills a small part of its box: look at those cells only.
    cells = np.nonzero(stored[:-1, :-1, :-1])
    at_centres = velocity[cells]
    for axis in range(3):
        if staggered[axis]:
            upper = tuple(index + (a == axis) for a, index in enumerate(cells))
            is_there = stored[upper]
            mean = 0.5 * (at_centres[:, axis] + velocity[(*upper, axis)])
            at_centres[is_there, axis] = mean[is_there]
    result[cells] = at_centres
    return result


def extrapolated(
    velocity: FloatArray, known: BoolArray, layers: int
) -> tuple[FloatArray, BoolArray]:
    """Velocity, or any vectors, continued from known cells outwards, layer by layer.

    A cell becomes the mean of those of its six neighbours that were known a layer before, so
    a constant velocity is continued exactly.

    Args:
        velocity: `[x, y, z, 3]`.
        known: `[x, y, z]`.
        layers: How many cells far.

    Returns:
        The velocity, zero where it is still unknown, and where it is known now.
    """
    result, filled = np.where(known[..., None], velocity, velocity.dtype.type(0)), known.copy()
    # The same laid out flat, where a list of cells is much quicker to fetch.
    values, is_filled = result.reshape(-1, 3), filled.reshape(-1)
    for _ in range(layers):
        front = np.flatnonzero(_rim(filled) & ~filled)
        # In double precision the sum of up to six equal floats is exact.
        total, count = np.zeros((len(front), 3)), np.zeros(len(front))
        places = np.unravel_index(front, known.shape)
        for axis, step in product(range(3), (-1, 1)):
            # At the edge of the array a cell is its own neighbour: not filled, and zero.
            place = [at + step * (a == axis) for a, at in enumerate(places)]
            beside = np.ravel_multi_index(place, known.shape, mode="clip")
            total += values.take(beside, axis=0)
            count += is_filled.take(beside)
        values[front] = total / count[:, None]
        is_filled[front] = True
    return result, filled


def _rim(known: BoolArray) -> BoolArray:
    """Cells with a known neighbour."""
    rim = np.zeros_like(known)
    for axis in range(3):
        lower = tuple(slice(None, -1) if a == axis else slice(None) for a in range(3))
        upper = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
        rim[lower] |= known[upper]
        rim[upper] |= known[lower]
    return rim


def cells_per_frame(
    units: VelocityUnits, *, fps: float, time_scale: float, index_to_world: AnyArray
) -> AnyArray:
    """The 3×3 matrix that takes a velocity of a file to cells per frame.

    Args:
        units: `cells/frame` is kept; `m/s` is a velocity in the world, v · time_scale / (fps ·
            voxel size) along each axis; `mantaflow` is what Blender's cache stores, nominally
            v · 0.1 · (25 / fps) · time_scale.
        fps: Frames a second.
        time_scale: The simulation's own factor on time.
        index_to_world: 4×4, for `m/s`.

    Raises:
        OptionError: If the units are unknown, or a number is not positive.
    """
    if units not in UNITS:
        raise OptionError(f"velocity_units: expected one of {', '.join(UNITS)}, got {units!r}")
    for name, value in (("fps", fps), ("time_scale", time_scale)):
        if not 0 < value < np.inf:
            raise OptionError(f"{name}: expected a positive number, got {value}")
    if units == "m/s":
        return np.linalg.inv(index_to_world[:3, :3]) * (time_scale / fps)
    if units == "mantaflow":
        return np.eye(3) * (_MANTAFLOW_STEP * _MANTAFLOW_FPS / fps * time_scale)
    return np.eye(3)


def fit_velocity_scale(first: Volume, second: Volume) -> float:
    """The factor on the first frame's velocity that best carries its density to the second.

    Density is fetched from a midpoint step back along the scaled velocity and compared with the
    second frame where the two frames differ. Large residuals count little: a source refills what
    flows out of it, whatever the velocity.

    Args:
        first: A frame with velocity.
        second: The next frame.

    Returns:
        The factor, between 0 and 4.

    Raises:
        GridError: If the first frame has no velocity, no smoke moves between the two, or no
            factor explains how.
        BackendUnavailableError: If scipy is not installed.
    """
    try:
        from scipy import ndimage, optimize
    except ImportError as error:
        raise BackendUnavailableError(
            "velocity_scale: fitting needs scipy, which is not installed: pip install 'vnca[train]'"
        ) from error
    if first.velocity is None:
        raise GridError(f"frame {first.frame}: no velocity to fit a scale to")
    box = first.box.union(second.box).grown(1)
    before, after = _within(first.density, first.box, box), _within(second.density, second.box, box)
    velocity = _within(first.velocity, first.box, box)
    velocity, _ = extrapolated(velocity, np.asarray(velocity.any(axis=-1)), _FIT_LAYERS)
    unit = max(before.max(), after.max())
    where = np.nonzero(np.abs(after - before) > _FIT_CHANGE * unit)
    wanted, here = after[where], np.stack(where).astype(np.float32)
    if not velocity[where].any():
        raise GridError(f"frames {first.frame} and {second.frame}: no moving smoke to fit to")
    spline = np.asarray(ndimage.spline_filter(before, order=3))
    components = [np.ascontiguousarray(velocity[..., axis]) for axis in range(3)]

    def mismatch(scale: float) -> float:
        halfway = here - 0.5 * scale * velocity[where].T
        drift = [ndimage.map_coordinates(v, halfway, order=1, mode="nearest") for v in components]
        moved = ndimage.map_coordinates(spline, here - scale * np.stack(drift), prefilter=False)
        residual = (np.asarray(moved) - wanted) / (_FIT_TOLERANCE * unit)
        return float(np.sum(1 - np.exp(-(residual**2))))

    # There can be several minima: look around first, refine about the best.
    tried = np.linspace(0, _FIT_MOST, 33)
    best = int(np.argmin([mismatch(scale) for scale in tried]))
    if best in (0, len(tried) - 1):
        raise GridError(
            f"frames {first.frame} and {second.frame}: no velocity scale up to {_FIT_MOST:g} "
            "carries one to the other; check --velocity-units, or set --velocity-scale"
        )
    bounds = tried[best - 1], tried[best + 1]
    fit: Any = optimize.minimize_scalar(mismatch, bounds=bounds, method="bounded")
    return float(fit.x)


def _within(array: AnyArray, box: Box, whole: Box) -> AnyArray:
    """`array`, which covers `box`, in an array of zeros that covers `whole`."""
    result = np.zeros((*whole.shape, *array.shape[3:]), array.dtype)
    result[box.slices(whole)] = array
    return result
