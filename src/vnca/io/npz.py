"""Smoke in Mantaflow's npz layout, as published with earlier work on smoke stylization.

A folder holds `d/%03d.npz` with density `[z, y, x]` or `[z, y, x, 1]` and `v/%03d.npz` with
velocity `[z, y, x, 3]`, each under the key `x`. Components are in the order x, y, z and lie on the
lower faces of their cells; up is +y. There is no voxel size: a cell is one unit of the world.

Reference: Kim et al. 2019, "Transport-Based Neural Style Transfer for Smoke Simulations".
"""

import math
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.errors import FileFormatError, GridError, OptionError
from vnca.core.field import Field
from vnca.core.files import existing_file
from vnca.io.smoke_format import (
    NO_VELOCITY,
    NOT_WANTED,
    Extent,
    Reader,
    SmokeFormat,
    StoredSmoke,
    StoredVelocity,
    single_precision,
    upper_grown,
)

KEY = "x"
MOST_VALUES = 2**31
_MOST_HEADER = 1024  # bytes; numpy writes 128
_MOST_KEYS = 8  # that a message lists
_MOST_DEFLATED = 1032  # bytes that one byte of a deflated stream can stand for
_PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_npz_smoke(path: Path, format: SmokeFormat) -> StoredSmoke:
    """Density over the box of its non-zero cells, and velocity from the folder `v` beside `d`.

    A file that is not in a folder `d`, or has no folder `v` beside it, has no velocity.

    Raises:
        FileFormatError: If a file is missing, truncated, or holds something else.
        GridError: If density and velocity differ in extent, or values are not finite.
        OptionError: If further fields are asked for.
    """
    if format.fields:
        raise OptionError(f"`fields` {', '.join(format.fields)}: an npz file has none: {path}")
    density = read_npz_density(path)
    box = occupied_box(density)
    domain = Box((0, 0, 0), density.shape)
    beside = path.parent.parent / "v"
    velocity = None
    if format.velocity_grid != NO_VELOCITY and path.parent.name == "d" and beside.is_dir():
        velocity = _stored_velocity(beside / path.name, domain, box, format.staggered is not False)
    density = Field.from_dense(density[box.slices(domain)], box.lower)
    return StoredSmoke(density, np.eye(4), velocity)


def npz_smoke_extent(path: Path, format: SmokeFormat) -> Extent:
    """The box of the cells with density other than zero, of one unit of the world each.

    Raises:
        FileFormatError: If the file is missing, truncated, or holds something else.
    """
    return Extent(occupied_box(read_npz_density(path)), np.eye(4))


def where_npz_velocity_is(path: Path) -> str:
    """What to tell whoever expected velocity beside a file that has none."""
    return f"it would be in a folder v beside a folder d with this file ({NOT_WANTED})"


def read_npz_density(path: Path) -> FloatArray:
    """`[x, y, z]` over the whole domain.

    Raises:
        FileFormatError: If the file is missing, truncated, or holds something else.
        GridError: If values are not finite.
    """
    values = _read_array(path, "[z, y, x] or [z, y, x, 1]", components=(None, 1))
    return _ours(path, values.reshape(values.shape[:3]))


def read_npz_velocity(path: Path) -> FloatArray:
    """`[x, y, z, 3]` over the whole domain, on lower faces as stored.

    Raises:
        FileFormatError: If the file is missing, truncated, or holds something else.
        GridError: If values are not finite.
    """
    return _ours(path, _read_array(path, "[z, y, x, 3]", components=(3,)))


def occupied_box(density: FloatArray) -> Box:
    """The smallest box around the cells that are not zero; empty if all are."""
    occupied = density != 0
    lower, upper = [], []
    for axis in range(3):
        others = tuple(other for other in range(3) if other != axis)
        cells = np.flatnonzero(occupied.any(axis=others))
        if not len(cells):
            return Box((0, 0, 0), (0, 0, 0))
        lower.append(int(cells[0]))
        upper.append(int(cells[-1]) + 1)
    return Box((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


def _stored_velocity(path: Path, domain: Box, box: Box, staggered: bool) -> StoredVelocity:
    values = read_npz_velocity(path)
    if values.shape[:3] != domain.shape:
        raise GridError(
            f"{path}: velocity of {values.shape[:3]} cells (x, y, z), the density beside it has "
            f"{domain.shape}; leave the velocity out with `velocity_grid` none"
        )
    whole = upper_grown(box)
    inside = whole.intersection(domain)
    result = Field.from_dense(values[inside.slices(domain)], inside.lower)
    stored = Field.from_dense(np.ones(inside.shape, bool), inside.lower)
    faces = (staggered, staggered, staggered)
    return StoredVelocity(replace(result, box=whole), replace(stored, box=whole), faces)


def _ours(path: Path, values: AnyArray) -> FloatArray:
    """From `[z, y, x, ...]` to `[x, y, z, ...]`."""
    values = values.transpose(2, 1, 0, *range(3, values.ndim))
    with np.errstate(over="ignore"):
        turned = np.array(values, np.float32, order="C")
    return single_precision(turned, path, f"array {KEY!r}")


def _read_array(path: Path, layout: str, components: tuple[int | None, ...]) -> AnyArray:
    """The array of a file, after its header was found to be what is expected."""
    path = existing_file(path)
    with _npy_member(path) as (stream, size):
        shape, dtype, start = _read_header(stream)
        last = shape[3] if len(shape) == 4 else None
        if len(shape) not in (3, 4) or last not in components or dtype.kind != "f":
            raise FileFormatError(
                f"{path}: expected floats {layout} under {KEY!r}, found {dtype} {list(shape)}"
            )
        count = math.prod(shape)
        if min(shape) < 1 or count > MOST_VALUES:
            raise FileFormatError(f"{path}: an array of {count} values is empty or too large")
        if start + count * dtype.itemsize != size:
            raise FileFormatError(
                f"{path}: truncated or corrupt: the header promises "
                f"{count * dtype.itemsize} bytes, there are {size - start}"
            )
        stream.seek(0)
        return npy.read_array(stream, allow_pickle=False)


def _read_header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype, int]:
    """Shape and type of an array, and the byte where its values begin."""
    # numpy reads as many bytes as the header says it has, so it gets to see only so many.
    head = BytesIO(stream.read(_MOST_HEADER))
    try:
        shape, _, dtype = _HEADERS[npy.read_magic(head)](head)
    except Exception:  # numpy has Python parse it, which raises what the text makes it trip over
        raise ValueError("its array has no header that can be read") from None
    return shape, dtype, head.tell()


@contextmanager
def _npy_member(path: Path) -> Iterator[tuple[IO[bytes], int]]:
    """The array file under `KEY`, and its size in bytes."""
    name = f"{KEY}.npy"
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            if name not in names:
                keys = ", ".join(n.removesuffix(".npy") for n in names[:_MOST_KEYS]) or "nothing"
                more = f" and {len(names) - _MOST_KEYS} more" * (len(names) > _MOST_KEYS)
                raise FileFormatError(f"{path}: no array {KEY!r}; the file holds {keys}{more}")
            member = archive.getinfo(name)
            if member.compress_type not in _PACKINGS:
                raise FileFormatError(f"{path}: array {KEY!r} is packed otherwise than numpy does")
            if member.file_size > path.stat().st_size * _MOST_DEFLATED:
                raise FileFormatError(
                    f"{path}: truncated or corrupt: array {KEY!r} of {member.file_size} bytes "
                    "cannot come from a file this small"
                )
            with archive.open(member) as stream:
                yield stream, member.file_size
    except (
        OSError,
        EOFError,
        KeyError,
        ValueError,
        OverflowError,
        RuntimeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        reason = " ".join(str(error).split())
        raise FileFormatError(f"{path}: not a readable npz file ({reason})") from error


READER = Reader(read_npz_smoke, npz_smoke_extent, where_npz_velocity_is, up_axis="y")
