"""Velocity of OpenVDB grids that have other cells than the density: coarser, finer or shifted."""

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from vnca.bricks.field import Field
from vnca.bricks.places import EDGE, bricks_beside
from vnca.errors import GridError
from vnca.io.interpolation import interpolated
from vnca.io.smoke_format import SmokeFormat, StoredVelocity, single_precision, upper_grown
from vnca.io.vdb import GridHeader, Transform
from vnca.typing import AnyArray, BoolArray, Box, FloatArray, IntArray

_MOST_CELLS = 2**27  # as an array, 1.5 GB of vectors
_AT_ONCE = 2**18  # places that are looked at together
_TOLERANCE = 1e-6


def resampled_velocity(
    headers: Sequence[GridHeader],
    format: SmokeFormat,
    density: Field,
    place: Transform,
    *,
    told: bool,
) -> StoredVelocity:
    """Velocity at the centres of the density's cells, interpolated linearly where it is stored.

    A grid that is staggered has its components on the lower faces of its own cells. Three grids
    of numbers lie where their transforms say; only if that is one place for all three can they be
    staggered otherwise.

    Args:
        headers: One grid of vectors, or those of the components x, y and z.
        format: Whether velocity is staggered, unless the grids are to say.
        density: The smoke.
        place: Where its cells lie.
        told: Whether the file says that velocity is in cells per frame.

    Raises:
        FileFormatError: If a grid is truncated or corrupt.
        GridError: If components differ in their voxels, or a grid has no value near the density,
            too many, or some that are not finite.
    """
    first = headers[0].transform.index_to_world
    is_apart = False
    for header in headers[1:]:
        matrix = header.transform.index_to_world
        is_apart |= not np.allclose(matrix, first, rtol=_TOLERANCE, atol=0)
        if not np.allclose(matrix[:3, :3], first[:3, :3], rtol=_TOLERANCE, atol=0):
            raise GridError(
                f"{header.source.path}: velocity grids {headers[0].name!r} and {header.name!r} "
                "differ in their voxels; resample one, or leave the velocity out with "
                "--velocity-grid none"
            )
    faces = [0.5 * _is_staggered(h, format, is_apart) * np.eye(3) for h in headers]
    whole = upper_grown(density.box)
    bricks = bricks_beside(density.bricks)
    cells = _cells_of(bricks)
    if len(headers) == 3:
        parts = [_at_centres(h, cells, place, faces[a][a]) for a, h in enumerate(headers)]
        values = np.concatenate([part for part, _ in parts], axis=-1)
        # A component that is zero everywhere may not be stored at all.
        stored = np.logical_or.reduce([known for _, known in parts])
    elif faces[0].any():
        parts = [_at_centres(headers[0], cells, place, face) for face in faces[0]]
        values = np.stack([part[..., axis] for axis, (part, _) in enumerate(parts)], axis=-1)
        stored = np.logical_and.reduce([known for _, known in parts])
    else:
        values, stored = _at_centres(headers[0], cells, place, np.zeros(3))
    to_ours = np.linalg.solve(place.index_to_world[:3, :3], first[:3, :3])
    shape = (len(bricks), EDGE, EDGE, EDGE)
    return StoredVelocity(
        Field(bricks, values.reshape(*shape, 3), whole).within(whole),
        Field(bricks, stored.reshape(shape), whole, outside=False).within(whole),
        (False, False, False),
        told,
        to_ours,
    )


def _cells_of(bricks: IntArray) -> IntArray:
    """All cells `[512 m, 3]` of bricks `[m, 3]`, brick by brick, z fastest."""
    inside = np.indices((EDGE, EDGE, EDGE), np.int32).reshape(3, -1).T
    return (bricks[:, None] * np.int32(EDGE) + inside).reshape(-1, 3)


def _is_staggered(header: GridHeader, format: SmokeFormat, is_apart: bool) -> bool:
    if is_apart:
        return False
    return header.grid_class == "staggered" if format.staggered is None else format.staggered


def _at_centres(
    header: GridHeader, cells: IntArray, density: Transform, shift: AnyArray
) -> tuple[FloatArray, BoolArray]:
    """Values `[n, c]` of a grid at the centres of the density's cells, and where it has any.

    `shift` is where the values lie below the centres of the grid's own cells.

    Raises:
        FileFormatError: If it is truncated or corrupt.
        GridError: If it has values, but none near those cells, too many, or bad ones.
    """
    label = f"{header.source.path}: velocity grid {header.name!r}"
    to_its = np.linalg.solve(header.transform.index_to_world, density.index_to_world)
    to_its[:3, 3] += shift
    grid = header.read()
    there = grid.active_box()
    components = grid.tree.leaf_values.shape[2:] or (1,)
    values, known = np.zeros((len(cells), *components), np.float32), np.zeros(len(cells), np.bool_)
    if there.is_empty or not len(cells):
        return values, known
    # With a layer of cells around that have no value, for places beyond the last that have one.
    part = _needed(cells, to_its).intersection(there.grown(1))
    if math.prod(part.shape) > _MOST_CELLS:
        raise GridError(
            f"{label} has {' × '.join(map(str, part.shape))} cells where the smoke is, of "
            f"{_MOST_CELLS} at most; resample it, or leave it out with --velocity-grid none"
        )
    if not part.is_empty:
        stored, active = grid.to_dense(part, fill=0)
        stored = single_precision(stored, header.source.path, f"grid {header.name!r}")
        stored = stored.reshape(*active.shape, *components)
        for start in range(0, len(cells), _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            at = cells[some] @ to_its[:3, :3].T + (to_its[:3, 3] - part.lower)
            values[some], known[some] = interpolated(stored, active, at)
    if not known.any():
        raise GridError(
            f"{label} has no value near the smoke: they do not meet; leave the velocity out with "
            "--velocity-grid none"
        )
    return values, known


def _needed(cells: IntArray, to_its: AnyArray) -> Box:
    """The cells of a grid around the centres of another's, given 4×4 from those to its indices."""
    x, y, z = zip(cells.min(axis=0).tolist(), cells.max(axis=0).tolist(), strict=True)
    corners = np.array(list(product(x, y, z, (1,)))) @ to_its[:3].T
    a, b, c = (math.floor(low) for low in corners.min(axis=0))
    i, j, k = (math.ceil(high) + 1 for high in corners.max(axis=0))
    return Box((a, b, c), (i, j, k))
