"""Velocity as files have it, made into cells per frame at cell centres in and near the smoke."""

from dataclasses import replace
from itertools import product
from typing import Any, Literal, TypeAlias

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, FloatArray
from vnca.core.bricks import CELLS, EDGE, cells_at
from vnca.core.errors import BackendUnavailableError, GridError, OptionError
from vnca.core.field import Field, dilated
from vnca.core.marks import WAYS, Marks, packed, unpacked
from vnca.core.volume import Volume
from vnca.engine import native

_LEAST_SHARE = 1e-6
_TRACED_AT_ONCE = 1 << 15  # what that takes fits into a cache
_SAMPLE, _FEWEST_CHANGES = 4000, 64
_FAR_OFF, _CLEARLY = 4, 0.8
VelocityUnits: TypeAlias = Literal["cells/frame", "m/s", "mantaflow"]
UNITS: tuple[VelocityUnits, ...] = ("cells/frame", "m/s", "mantaflow")
# Blender's fluid solver steps in tenths of its unit of time at 25 frames a second.
_MANTAFLOW_STEP, _MANTAFLOW_FPS = 0.1, 25.0
_FIT_MOST = 4.0
_FIT_LAYERS = 6
# As fractions of the greatest density: what counts as a change, and as a large residual.
_FIT_CHANGE, _FIT_TOLERANCE = 0.05, 0.1


def interpolated(values: Field, known: Field, places: AnyArray) -> tuple[FloatArray, BoolArray]:
    """Values interpolated linearly between the known ones of the eight cells around each place.

    The shares of known cells are scaled to add up to one: a constant stays what it is up to where
    the last known cell ends.

    Args:
        values: `[..., c]`.
        known: Which cells of the same box have a value.
        places: `[n, 3]`, index coordinates; beyond the outermost centres of the box the outermost
            cells count.

    Returns:
        `[n, c]`, zero where nothing near is known, and where something is, `[n]`.
    """
    first, last = np.array(known.box.lower), np.array(known.box.upper) - 1
    places = np.clip(places, first, last)
    below = np.minimum(np.floor(places), np.maximum(last - 1, first)).astype(np.int32)
    upper = (places - below).astype(np.float32).T
    shares = (1 - upper, upper)
    # Laid out flat, and not copied where that can be helped: there may be few places.
    blocks = values.values if values.bricks is known.bricks else values.blocks(known.bricks)
    count = blocks.shape[-1]
    flat_values, flat_known = blocks.reshape(-1, count), known.values.reshape(-1)
    total = np.zeros((len(places), count), np.float32)
    weight = np.zeros(len(places), np.float32)
    for corner in product((0, 1), repeat=3) if len(flat_known) else ():
        # An axis of one cell has no cell above: the share of it is none.
        cells = known.find(below + np.array(corner, np.int32) * (last > first))
        i, j, k = corner
        share = shares[i][0] * shares[j][1] * shares[k][2]
        share *= (cells < len(flat_known)) & flat_known.take(cells, mode="clip")
        total += share[:, None] * flat_values.take(cells, axis=0, mode="clip")
        weight += share
    is_known = weight > _LEAST_SHARE
    total /= np.where(is_known, weight, 1)[:, None]
    total[~is_known] = 0
    return total, is_known


def centred(
    velocity: Field,
    stored: Field,
    staggered: tuple[bool, bool, bool] = (True, True, True),
) -> tuple[Field, Field]:
    """Velocity on lower faces, averaged to cell centres.

    Component `a` of cell `i` lies on the face towards `i - 1` along axis `a`; the face on the
    other side belongs to the next cell. Where that one is not stored, the lower face alone counts.

    Args:
        velocity: `[..., 3]`, with one layer of cells more than is wanted at each upper end.
        stored: Which cells have a velocity.
        staggered: Which components lie on faces; the others are at centres already.

    Returns:
        The velocity without those layers, zero where nothing is stored, and which cells are.
    """
    x, y, z = velocity.box.upper
    box = Box(velocity.box.lower, (x - 1, y - 1, z - 1))
    faces = replace(velocity, bricks=stored.bricks, values=velocity.blocks(stored.bricks))
    faces.values[~stored.values] = 0
    result = faces.values.copy()
    for axis in range(3):
        if staggered[axis]:
            lower = replace(faces, values=faces.values[..., axis])
            mean = 0.5 * (lower.values + lower.shifted(axis, 1))
            both = stored.values & stored.shifted(axis, 1)
            result[..., axis] = np.where(both, mean, lower.values)
    return replace(faces, values=result).within(box), stored.within(box)


def extrapolated(values: Field, known: Field, layers: int) -> tuple[Field, Field]:
    """Velocity, or any vectors, continued from known cells outwards, layer by layer.

    A cell becomes the mean of those of its six neighbours that were known a layer before, so
    a constant velocity is continued exactly.

    Args:
        values: `[..., 3]`.
        known: Where they are known, in the same box.
        layers: How many cells far.

    Returns:
        The values, zero where they are still unknown, and where they are known now.
    """
    reached = dilated(known, layers)
    box, bricks = reached.box, reached.bricks
    inside = replace(reached, values=np.ones_like(reached.values), outside=False).within(box).values
    filled = known.blocks(bricks)
    # Laid out flat, where a list of cells is much quicker to fetch; and nothing behind.
    flat = np.concatenate(
        [values.blocks(bricks).reshape(-1, 3), np.zeros((CELLS, 3), values.values.dtype)]
    )
    flat[:-CELLS][~filled.reshape(-1)] = 0
    is_filled = np.concatenate([filled.reshape(-1), np.zeros(CELLS, bool)])
    marks, bits, wanted = Marks(bricks), packed(filled), packed(inside)
    beside = np.stack(list(marks.rows_beside.values())) * CELLS
    fill = native.fill if native.unavailable() is None else fill_with_means
    for _ in range(layers):
        rim = marks.beside(bits) & wanted & ~bits
        bits |= rim
        front = np.flatnonzero(unpacked(rim))
        fill(flat, is_filled, front, beside)
        is_filled[front] = True
    shape = filled.shape
    found, known_now = flat[:-CELLS].reshape(*shape, 3), is_filled[:-CELLS].reshape(shape)
    return Field(bricks, found, box), replace(known, bricks=bricks, values=known_now)


def fill_with_means(
    values: FloatArray, known: BoolArray, cells: AnyArray, beside: AnyArray
) -> None:
    """As `vnca.engine.native.fill`, in numpy."""
    # In double precision the sum of up to six equal floats is exact.
    total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for (axis, step), bricks in zip(WAYS, beside, strict=True):
        there = _next_cells(cells, axis, step, bricks)
        total += np.where(known.take(there)[:, None], values.take(there, axis=0), 0)
        count += known.take(there)
    values[cells] = total / count[:, None]


def _next_cells(cells: AnyArray, axis: int, step: int, beside: AnyArray) -> AnyArray:
    """Flat places of the cells next to some, by their flat places.

    Args:
        cells: `[n]`.
        axis: Along which axis.
        step: 1 up or -1 down.
        beside: Flat place `[m]` of the first cell of the brick beside each.
    """
    stride = EDGE ** (2 - axis)
    at_end = (cells // stride) % EDGE == (EDGE - 1 if step > 0 else 0)
    result = cells + step * stride
    leaving = cells[at_end]
    result[at_end] = beside[leaving // CELLS] + leaving % CELLS - step * (EDGE - 1) * stride
    return result


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


def carried_to(
    cells: AnyArray, velocity: Field, frames: Any, *, threads: int | None = None
) -> FloatArray:
    """By how much what is at cells `[n, 3]` has come to them, `[n, 3]`: a midpoint step back.

    Where no velocity is known halfway, that at the cell counts. Natively where the native extension
    is, else in numpy: to the same bits.

    Args:
        cells: Index coordinates.
        velocity: `[..., 3]`, cells per frame; known where it is not zero.
        frames: The time, one or of each cell `[n]`; below zero it goes back.
        threads: Of the native core; one for each core unless given.
    """
    if native.unavailable() is not None:
        return carried_to_by_numpy(cells, velocity, frames)
    moved = np.zeros((len(cells), 3), np.float32)
    if not velocity.box.is_empty:
        values = np.ascontiguousarray(velocity.values, np.float32)
        bricks, cells = (np.ascontiguousarray(each, np.int32) for each in (velocity.bricks, cells))
        arrays = (values, bricks, *map(tuple, velocity.box), _LEAST_SHARE)
        times = np.array(frames, np.float32).reshape(-1)
        how = (cells, times, moved, threads or native.default_threads())
        native.checked("tracing back", native.extension().trace, *arrays, *how)
    return moved


def carried_to_by_numpy(cells: AnyArray, velocity: Field, frames: Any) -> FloatArray:
    """As `carried_to`, readable."""
    known = replace(velocity, values=velocity.values.any(axis=-1), outside=False)
    time = np.broadcast_to(np.float32(frames), len(cells))[:, None]
    moved = np.empty((len(cells), 3), np.float32)
    for start in range(0, len(cells), _TRACED_AT_ONCE):
        some = slice(start, start + _TRACED_AT_ONCE)
        by = time[some] * velocity.gather(cells[some])
        halfway, found = interpolated(velocity, known, cells[some] - 0.5 * by)
        by[found] = (time[some] * halfway)[found]
        moved[some] = by
    return moved


def likely_velocity_scale(first: Volume, second: Volume) -> float:
    """By what power of two the first frame's velocity seems to be off; 1 unless it is clear.

    Units that were not named are far off, and that shows without a fit: at a sample of the cells
    whose density changes, what each scale fetches from upstream is compared with the second frame.

    Args:
        first: A frame.
        second: The next one.
    """
    velocity = first.velocity_field
    if velocity is None:
        return 1.0
    box = first.box.union(second.box).grown(1)
    velocity, before, after = (
        replace(each, box=box) for each in (velocity, first.density_field, second.density_field)
    )
    smoke, smoke_after = (
        replace(each, values=each.values > 0, outside=False) for each in (before, after)
    )
    smoke = smoke.union(smoke_after)
    cells = cells_at(smoke.bricks, smoke.values)
    here, there = before.gather(cells), after.gather(cells)
    unit = max(here.max(initial=0), there.max(initial=0))
    cells = cells[np.abs(there - here) > _FIT_CHANGE * unit]
    cells = cells[:: len(cells) // _SAMPLE + 1]
    if len(cells) < _FEWEST_CHANGES:
        return 1.0
    here, there = before.gather(cells), after.gather(cells)
    density = replace(before, values=before.values[..., None])
    stored = replace(before, values=np.ones(before.values.shape, bool), outside=False)

    def mismatch(scale: float) -> float:
        upstream = cells - carried_to(cells, velocity, scale)
        fetched = interpolated(density, stored, upstream)[0][:, 0]
        return float(np.abs(fetched - there).mean() / np.abs(here - there).mean())

    found = {2.0**power: mismatch(2.0**power) for power in range(-7, 8)}
    best = min(found, key=lambda scale: found[scale])
    is_far_off = not 1 / _FAR_OFF < best < _FAR_OFF
    return best if is_far_off and found[best] < _CLEARLY * found[1.0] else 1.0


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
    moving = first.velocity_field
    if moving is None:
        raise GridError(f"frame {first.frame}: no velocity to fit a scale to")
    box = first.box.union(second.box).grown(1)
    both = f"frames {first.frame} and {second.frame}"
    before, after = (frame.density_field.dense(box, what=both) for frame in (first, second))
    moving = replace(moving, box=box)
    known = replace(moving, values=moving.values.any(axis=-1), outside=False)
    velocity = extrapolated(moving, known, _FIT_LAYERS)[0].dense()
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
            "carries one to the other; check `velocity_units`, or set `velocity_scale`"
        )
    bounds = tried[best - 1], tried[best + 1]
    fit: Any = optimize.minimize_scalar(mismatch, bounds=bounds, method="bounded")
    return float(fit.x)
