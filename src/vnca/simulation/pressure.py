"""Pressure that makes a flow free of divergence, in a box of walls, open sides and obstacles.

Without obstacles the seven-point Laplacian is diagonal in bases of cosines and sines, and solved
exactly in this discretisation. Obstacles break that: then it is solved by conjugate gradients, for
which the exact solution of the box without them is the preconditioner.

Reference: Fedkiw, Stam and Jensen 2001; Strang 1999 (bases of cosines by boundary condition).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vnca.core import AnyArray, BoolArray, FloatArray
from vnca.core.errors import OptionError

AXES = (0, 1, 2)
Open = tuple[tuple[bool, bool], tuple[bool, bool], tuple[bool, bool]]
"""For each axis, whether the side at its lower and that at its upper end are open."""
CEILING: Open = ((False, False), (False, False), (False, True))
ALL_OPEN: Open = ((True, True), (True, True), (True, True))
_TOLERANCE, _MOST_ITERATIONS = 1e-4, 60
# By what is at both ends: the type of the transform, and where its waves begin, in halves.
_BASES = {(False, False): 2, (False, True): 4, (True, True): 2}


@dataclass(frozen=True, eq=False)
class Pressure:
    """Solves for pressure.

    Attributes:
        opened: Which sides of the box are open; a lower one only if the upper one is, too.
        solid: `[x, y, z]`, cells that an obstacle fills; None if there is none.
    """

    opened: Open = CEILING
    solid: BoolArray | None = None

    def __post_init__(self) -> None:
        if any(lower and not upper for lower, upper in self.opened):
            raise OptionError("opened: a lower side is open only if the upper one is, too")

    def close(self, faces: list[FloatArray]) -> None:
        """Stop what flows through walls and obstacles."""
        for axis in AXES:
            for end, is_open in zip((0, -1), self.opened[axis], strict=True):
                if not is_open:
                    faces[axis][along(axis, end)] = 0
        if self.solid is not None:
            for face, closed in zip(faces, self._closed, strict=True):
                face[closed] = 0

    def project(self, faces: list[FloatArray], divergence: FloatArray) -> None:
        """Take the gradient of the pressure from a flow that stops at walls.

        Args:
            faces: Velocity components on the faces across each axis; changed.
            divergence: `[x, y, z]` of it.
        """
        pressure = self._boxed(divergence) if self.solid is None else self._around(divergence)
        steps = self._gradient(pressure)
        for face, step in zip(faces, steps, strict=True):
            face -= step

    def _gradient(self, pressure: FloatArray) -> list[FloatArray]:
        """The pressure's differences across the faces; none where air cannot flow.

        Beyond an open side the pressure is odd about the face: zero there.
        """
        found = []
        for axis in AXES:
            shape = [n + (a == axis) for a, n in enumerate(pressure.shape)]
            step = np.zeros(shape, pressure.dtype)
            step[along(axis, slice(1, -1))] = np.diff(pressure, axis=axis)
            lower, upper = self.opened[axis]
            if lower:
                step[along(axis, 0)] = 2 * pressure[along(axis, 0)]
            if upper:
                step[along(axis, -1)] = -2 * pressure[along(axis, -1)]
            if self.solid is not None:
                step[self._closed[axis]] = 0
            found.append(step)
        return found

    @cached_property
    def _closed(self) -> list[BoolArray]:
        """Which faces touch an obstacle."""
        assert self.solid is not None
        found = []
        for axis in AXES:
            width = [(1, 1) if a == axis else (0, 0) for a in AXES]
            wide = np.pad(self.solid, width)
            found.append(wide[along(axis, slice(None, -1))] | wide[along(axis, slice(1, None))])
        return found

    def _boxed(self, divergence: FloatArray) -> FloatArray:
        """The pressure in a box without obstacles, exactly."""
        from scipy import fft

        kinds = [self.opened[axis] for axis in AXES]
        walls, mixed, opened = ([axis for axis in AXES if kinds[axis] == kind] for kind in _BASES)
        spectrum: AnyArray = divergence
        if walls:
            spectrum = np.asarray(fft.dctn(spectrum, type=2, axes=walls, norm="ortho"))
        for axis in mixed:
            spectrum = np.asarray(fft.dct(spectrum, type=4, axis=axis, norm="ortho"))
        for axis in opened:
            spectrum = np.asarray(fft.dst(spectrum, type=2, axis=axis, norm="ortho"))
        x, y, z = (self._eigenvalues(axis, n) for axis, n in enumerate(divergence.shape))
        total = x[:, None, None] + y[:, None] + z
        if len(walls) == len(AXES):
            total[0, 0, 0] = 1  # pressure between walls is known but for a constant
        spectrum /= total
        for axis in opened:
            spectrum = np.asarray(fft.idst(spectrum, type=2, axis=axis, norm="ortho"))
        for axis in mixed:
            spectrum = np.asarray(fft.idct(spectrum, type=4, axis=axis, norm="ortho"))
        if walls:
            spectrum = np.asarray(fft.idctn(spectrum, type=2, axes=walls, norm="ortho"))
        return spectrum

    def _eigenvalues(self, axis: int, cells: int) -> FloatArray:
        """Of the second difference along an axis."""
        wave = np.arange(cells, dtype=np.float32)
        if self.opened[axis] == (False, True):
            wave = wave + 0.5
        elif self.opened[axis] == (True, True):
            wave = wave + 1
        return 2 * np.cos(np.pi / cells * wave, dtype=np.float32) - 2

    def _around(self, divergence: FloatArray) -> FloatArray:
        """The pressure around obstacles, until the divergence left is small beside what was."""
        from scipy.sparse.linalg import LinearOperator, cg

        assert self.solid is not None
        shape, air = divergence.shape, ~self.solid

        def laplacian(flat: AnyArray) -> AnyArray:
            steps = self._gradient(flat.reshape(shape))
            total = sum(
                (np.diff(step, axis=axis) for axis, step in enumerate(steps)),
                start=np.zeros(shape, np.float32),
            )
            # Solid cells have no pressure; minus, for what is solved is to be positive.
            return np.where(air, -total, flat.reshape(shape)).ravel()

        def without(flat: AnyArray) -> AnyArray:
            return np.where(air, -self._boxed(flat.reshape(shape)), flat.reshape(shape)).ravel()

        size = divergence.size
        wanted = np.where(air, -divergence, 0).astype(np.float32).ravel()
        if not wanted.any():
            return np.zeros(shape, np.float32)
        operator, preconditioner = (
            LinearOperator((size, size), matvec=matvec, dtype=np.float32)  # pyright: ignore[reportCallIssue]
            for matvec in (laplacian, without)
        )
        found, _ = cg(operator, wanted, rtol=_TOLERANCE, maxiter=_MOST_ITERATIONS, M=preconditioner)
        return found.astype(np.float32).reshape(shape)


def along(axis: int, index: int | slice) -> tuple[int | slice, ...]:
    """An index that picks along one axis, and all of the others."""
    return tuple(index if a == axis else slice(None) for a in AXES)
