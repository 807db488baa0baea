"""Vectors over a picture, from files: NumPy, Middlebury's .flo, and OpenEXR as renderers write it.

Reference: Baker et al. 2011, "A Database and Evaluation Methodology for Optical Flow" (.flo).
"""

from pathlib import Path

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import FileFormatError
from vnca.core.files import existing_file
from vnca.io.linear_picture import read_exr

_FLO = np.float32(202021.25)
MOST_PIXELS = 2**26
"""Larger fields are refused."""


def read_vectors(path: Path) -> FloatArray:
    """Vectors `[r, c, 2]`, right and up, row 0 at the top, in the unit of the file.

    A .npy file holds just that. A .flo file has them to the right and down, and says where a
    vector is not known by a very large one: it is zero here. OpenEXR has them in red and green.

    Raises:
        FileFormatError: If the file is missing, damaged, of another kind, or not all finite.
        BackendUnavailableError: If OpenEXR is asked for and not installed.
    """
    existing_file(path)
    if path.suffix.lower() not in _READERS:
        raise FileFormatError(f"{path}: expected vectors in a file of {', '.join(_READERS)}")
    try:
        found = _READERS[path.suffix.lower()](path)
    except (EOFError, OSError, ValueError) as error:
        raise FileFormatError(f"{path}: cannot be read as vectors ({error})") from error
    if found.ndim != 3 or found.shape[2] != 2 or 0 in found.shape:
        raise FileFormatError(f"{path}: expected vectors [row, column, 2], got {found.shape}")
    if found.dtype.kind not in "fiu" or not np.isfinite(found).all():
        raise FileFormatError(f"{path}: expected finite numbers")
    return np.ascontiguousarray(found, np.float32)


def _npy(path: Path) -> AnyArray:
    return np.load(path, allow_pickle=False, mmap_mode="r")


def _flo(path: Path) -> AnyArray:
    with path.open("rb") as file:
        head = np.fromfile(file, "<f4", 1)
        size = np.fromfile(file, "<i4", 2)
        if len(size) < 2 or head[0] != _FLO:
            raise ValueError("it does not begin as a .flo file does")
        columns, rows = map(int, size)
        if not (columns > 0 and rows > 0 and columns * rows <= MOST_PIXELS):
            raise ValueError(f"{columns} × {rows} vectors")
        values = np.fromfile(file, "<f4", 2 * rows * columns)
    if len(values) < 2 * rows * columns:
        raise ValueError("it ends early")
    vectors = values.reshape(rows, columns, 2) * np.array([1, -1], np.float32)
    unknown = np.abs(vectors).max(axis=-1, keepdims=True) > 1e9
    return np.where(unknown, 0, vectors)


def _exr(path: Path) -> AnyArray:
    return read_exr(path, MOST_PIXELS)[0][..., :2]


_READERS = {".npy": _npy, ".flo": _flo, ".exr": _exr}
SUFFIXES = tuple(_READERS)
