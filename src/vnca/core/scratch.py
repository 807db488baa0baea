"""Rows of numbers out of memory, in a file that has no name and is gone with the program."""

import math
import tempfile
import weakref
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from vnca.core import AnyArray
from vnca.core.errors import OutputError


class Scratch:
    """Rows that are added to the end of a file and read by their numbers, by any thread.

    Nothing is left behind, however the program ends.

    Attributes:
        shape: Like that of an array: rows, and each one's own.
        dtype: Of the numbers.
    """

    def __init__(self, folder: Path, row: tuple[int, ...], dtype: DTypeLike = np.float32) -> None:
        """An empty file in a folder, which is made if it is not there.

        Raises:
            OutputError: If none can be made.
        """
        self.dtype = np.dtype(dtype)
        self.shape: tuple[int, ...] = (0, *row)
        self._folder = folder
        self._stride = math.prod(row) * self.dtype.itemsize
        # The file has one place where it is read and written. A painting's state is kept beside
        # the painting of the next frame, which reads it too.
        self._placed = Lock()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
            weakref.finalize(self, self._file.close)
        except OSError as error:
            raise self._failed(error) from error

    def __len__(self) -> int:
        """How many rows there are."""
        return self.shape[0]

    def append(self, rows: AnyArray) -> int:
        """Add rows `[n, ...]`; the number of the first.

        Raises:
            OutputError: If the disk is full.
        """
        data: Any = np.ascontiguousarray(rows, self.dtype)
        assert data.shape[1:] == self.shape[1:], f"rows of {data.shape[1:]}, not {self.shape[1:]}"
        left = memoryview(data.reshape(-1)).cast("B")
        with self._placed:
            first = len(self)
            try:
                self._file.seek(first * self._stride)
                while left:
                    left = left[self._file.write(left) :]
            except OSError as error:
                raise self._failed(error) from error
            self.shape = (first + len(data), *self.shape[1:])
        return first

    def __getitem__(self, numbers: AnyArray) -> AnyArray:
        """The rows of some numbers `[n]`, in their order; quick where many follow one another."""
        rows = np.empty((len(numbers), *self.shape[1:]), self.dtype)
        begins = np.flatnonzero(np.diff(numbers, prepend=-2) != 1)
        ends = np.append(begins[1:], len(numbers))
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=False):
            self._fill(rows[begin:end], int(numbers[begin]))
        return rows

    def _fill(self, rows: Any, first: int) -> None:
        left = memoryview(rows.reshape(-1)).cast("B")
        with self._placed:
            try:
                self._file.seek(first * self._stride)
                while left:
                    count = self._file.readinto(left)
                    assert count, "rows that were never written"
                    left = left[count:]
            except OSError as error:
                raise self._failed(error) from error

    def _failed(self, error: OSError) -> OutputError:
        return OutputError(f"{self._folder}: no room for scratch files ({error.strerror or error})")
