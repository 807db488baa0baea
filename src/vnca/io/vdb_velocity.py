"""Velocity of OpenVDB files: which grids hold it, and how they are put on the density's cells.

The cells of a velocity grid may be coarser than those of the density, finer, or shifted.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.bricks import CELLS, EDGE, bricks_beside, bricks_reached, sorted_bricks
from vnca.core.errors import GridError
from vnca.core.field import Field
from vnca.io.smoke_format import (
    NO_VELOCITY,
    SmokeFormat,
    StoredVelocity,
    single_precision,
    upper_grown,
)
from vnca.io.vdb import VALUE_TYPES, GridHeader, Transform, VdbFile
from vnca.io.vdb.grid import MOST_TILE_CELLS
from vnca.io.velocity import interpolated

VELOCITY_NAMES = ("velocity", "vel", "v")
_AXES = ("xyz", "XYZ", "uvw", "UVW")
_WAY_OUT = "choose another with `velocity_grid`, or leave it out with `velocity_grid` none"
_SEPARATORS = (".", "_")
_BRICKS_AT_ONCE = 128
_TOLERANCE = 1e-6


def components(header: GridHeader) -> int | None:
    """1 for a grid of numbers, 3 for one of vectors, None for others."""
    value_type = VALUE_TYPES.get(header.value_type)
    return value_type.components if value_type else None


def listed_vectors(file: VdbFile) -> str:
    """What could be velocity: grids of vectors, and grids of numbers that are three of a kind.

    Empty if there are none.
    """
    vectors = [f"{name} ({header.value_type})" for name, header in _vectors(file).items()]
    triples = [parts for parts in _triples(file).values() if not _missing(file, parts)]
    return ", ".join(vectors + [f"{x} with {y} and {z}" for x, y, z in triples])


def velocity_headers(file: VdbFile, format: SmokeFormat) -> list[GridHeader]:
    """One grid of vectors, or three of numbers in the order x, y, z, or none; all can be placed.

    A grid of just the name counts first, or three such as NAME.x; then those of the name in any
    case, the axis behind `.`, `_` or nothing. Three are also chosen by the name of the first.

    Raises:
        GridError: If several could be it, a component is missing, one of the name is of a type that
            cannot be read, or lies where no linear transform puts it, or none has the name that
            was asked for.
    """
    headers = _named_velocity(file, format)
    for header in headers:
        if header.linear_transform is None:
            raise GridError(
                f"{file.path}: velocity grid {header.name!r} has a {header.map_type}, and only "
                f"linear transforms are supported; {_WAY_OUT}"
            )
    return headers


def _named_velocity(file: VdbFile, format: SmokeFormat) -> list[GridHeader]:
    asked = format.velocity_grid
    if asked == NO_VELOCITY:
        return []
    names = VELOCITY_NAMES if asked is None else (asked,)
    vectors, triples = _vectors(file), _triples(file)
    for name in names:
        if name in vectors:
            return [vectors[name]]
        for first in (f"{name}.x", name):
            if first in triples:
                return _three(file, triples[first])
    alike = {name.casefold() for name in names}
    like = [parts for parts in triples.values() if _stem(parts).casefold() in alike]
    found = [(name,) for name in vectors if name.casefold() in alike]
    found += [parts for parts in like if not _missing(file, parts)]
    if len(found) > 1:
        raise GridError(
            f"{file.path}: several grids could be the velocity; choose with `velocity_grid` from "
            f"{', '.join(parts[0] for parts in found)}"
        )
    if found:
        return [file.grids[part] for part in found[0]]
    if like:
        return _three(file, like[0])
    for name, header in file.grids.items():
        if components(header) is None and name.casefold() in alike:
            raise GridError(
                f"{file.path}: grid {name!r} is of type {header.value_type}, which cannot be read "
                f"as velocity; {_WAY_OUT}"
            )
    if asked is None:
        return []
    raise GridError(
        f"{file.path}: no velocity {asked!r}; choose with `velocity_grid` none or "
        f"a grid of vectors from {file.listed()}"
    )


def _vectors(file: VdbFile) -> dict[str, GridHeader]:
    return {name: header for name, header in file.grids.items() if components(header) == 3}


def _triples(file: VdbFile) -> dict[str, tuple[str, str, str]]:
    """Names that differ in their axis only, by the first: at least one of them is there.

    Bare u, v and w are three of a kind, too; bare x, y and z are places.
    """
    triples = {}
    for name, header in file.grids.items():
        for x, y, z in _AXES:
            if components(header) == 1 and name[-1:] in (x, y, z):
                parts = (name[:-1] + x, name[:-1] + y, name[:-1] + z)
                if _stem(parts) or (x in "uU" and not _missing(file, parts)):
                    triples[parts[0]] = parts
    return triples


def _stem(parts: tuple[str, str, str]) -> str:
    """`vel` of `vel.x`, `vel_x` or `velx`."""
    shared = parts[0][:-1]
    return shared[:-1] if shared.endswith(_SEPARATORS) else shared


def _missing(file: VdbFile, parts: tuple[str, str, str]) -> list[str]:
    return [p for p in parts if p not in file.grids or components(file.grids[p]) != 1]


def _three(file: VdbFile, parts: tuple[str, str, str]) -> list[GridHeader]:
    missing = _missing(file, parts)
    if missing:
        raise GridError(
            f"{file.path}: velocity {_stem(parts)!r} lacks the scalar grid {', '.join(missing)}; "
            "leave the velocity out with `velocity_grid` none"
        )
    return [file.grids[part] for part in parts]


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
        density: The density.
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
                "`velocity_grid` none"
            )
    faces = [0.5 * _is_staggered(h, format, is_apart) * np.eye(3) for h in headers]
    if len(headers) == 3:
        parts = [_at_centres(h, density, place, faces[a][a]) for a, h in enumerate(headers)]
        # A component that is zero everywhere may not be stored at all.
        combined = np.logical_or
    elif faces[0].any():
        parts = [_at_centres(headers[0], density, place, face) for face in faces[0]]
        parts = [
            (replace(part, values=part.values[..., axis, None]), known)
            for axis, (part, known) in enumerate(parts)
        ]
        combined = np.logical_and
    else:
        parts, combined = [_at_centres(headers[0], density, place, np.zeros(3))], np.logical_or
    bricks = sorted_bricks(np.concatenate([known.bricks for _, known in parts]))
    values = np.concatenate([part.blocks(bricks) for part, _ in parts], axis=-1)
    stored = combined.reduce([known.blocks(bricks) for _, known in parts])
    whole = upper_grown(density.box)
    to_ours = np.linalg.solve(place.index_to_world[:3, :3], first[:3, :3])
    return StoredVelocity(
        Field(bricks, values, whole),
        Field(bricks, stored, whole, outside=False),
        (False, False, False),
        told,
        to_ours,
    )


def _is_staggered(header: GridHeader, format: SmokeFormat, is_apart: bool) -> bool:
    if is_apart:
        return False
    return header.grid_class == "staggered" if format.staggered is None else format.staggered


def _at_centres(
    header: GridHeader, density: Field, place: Transform, shift: AnyArray
) -> tuple[Field, Field]:
    """Values `[..., c]` of a grid at the centres of the density's cells, and where it has any.

    They have one layer of cells more than the density at upper ends. `shift` is where the values
    lie below the centres of the grid's own cells.

    Raises:
        FileFormatError: If it is truncated or corrupt.
        GridError: If it has values, but none near those cells, too many, or bad ones.
    """
    label = f"{header.source.path}: velocity grid {header.name!r}"
    to_its = np.linalg.solve(header.transform.index_to_world, place.index_to_world)
    to_its[:3, 3] += shift
    box, grid = upper_grown(density.box), header.read()
    there = grid.active_box()
    kind = grid.tree.leaf_values.shape[2:] or (1,)
    # With a layer of cells around that have no value, for places beyond the last that have one.
    part = _needed(box, to_its).intersection(there.grown(1))
    if there.is_empty or density.box.is_empty:
        return _nothing(box, kind)
    beside, most = bricks_beside(density.bricks), MOST_TILE_CELLS // CELLS
    near = bricks_reached(beside, to_its, part, margin=1, most=most)
    if near is None:
        raise GridError(
            f"{label} has more cells where the smoke is than {MOST_TILE_CELLS}; resample it, or "
            "leave it out with `velocity_grid` none"
        )
    stored, active = grid.fields(part, near=near)
    what = f"grid {header.name!r}"
    found = single_precision(stored.values, header.source.path, what, stored=active.values)
    stored = replace(stored, values=found.reshape(*found.shape[:4], *kind))
    back = np.linalg.inv(to_its)
    bricks = bricks_reached(active.bricks, back, box, margin=1, most=most)
    if bricks is None:
        bricks = beside
    values = np.zeros((len(bricks), CELLS, *kind), np.float32)
    known = np.zeros((len(bricks), CELLS), np.bool_)
    cells = np.array(list(product(range(EDGE), repeat=3)))
    for start in range(0, len(bricks), _BRICKS_AT_ONCE):
        slab = slice(start, start + _BRICKS_AT_ONCE)
        at = (bricks[slab, None] * EDGE + cells).reshape(-1, 3)
        found, is_known = interpolated(stored, active, at @ to_its[:3, :3].T + to_its[:3, 3])
        values[slab], known[slab] = found.reshape(values[slab].shape), is_known.reshape(-1, CELLS)
    shape = (-1, EDGE, EDGE, EDGE)
    where = Field(bricks, known.reshape(shape), box, outside=False).within(box)
    if not where.values.any():
        raise GridError(
            f"{label} has no value near the smoke: they do not meet; leave the velocity out with "
            "`velocity_grid` none"
        )
    return Field(bricks, values.reshape(*shape, *kind), box).within(box), where


def _nothing(box: Box, kind: tuple[int, ...]) -> tuple[Field, Field]:
    bricks, shape = np.empty((0, 3), np.int32), (0, EDGE, EDGE, EDGE)
    values = Field(bricks, np.empty((*shape, *kind), np.float32), box)
    return values, Field(bricks, np.empty(shape, np.bool_), box, outside=False)


def _needed(box: Box, to_its: AnyArray) -> Box:
    """The cells of a grid around the centres of another's, given 4×4 from those to its indices."""
    x, y, z = ((low, high - 1) for low, high in zip(box.lower, box.upper, strict=True))
    corners = np.array(list(product(x, y, z, (1,)))) @ to_its[:3].T
    a, b, c = (math.floor(low) for low in corners.min(axis=0))
    i, j, k = (math.ceil(high) + 1 for high in corners.max(axis=0))
    return Box((a, b, c), (i, j, k))
