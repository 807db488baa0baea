"""A small smoke solver: MacCormack advection, vorticity confinement, pressure by cosine transforms.

The grid is staggered (MAC): density sits at cell centres, each velocity component on the faces
across its axis, with one more face than cells. Each side of the box is a wall or open. Lengths are
in cells, times in frames; one step is one frame.

Reference: Fedkiw, Stam and Jensen 2001 (buoyancy, vorticity confinement); Selle et al. 2008
(MacCormack advection with a limiter).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vnca.core import BoolArray, FloatArray, Index
from vnca.simulation.pressure import AXES, CEILING, Open, Pressure, along


@dataclass(frozen=True)
class Forces:
    """What drives and damps the smoke besides its sources.

    Attributes:
        buoyancy: Upward acceleration where density is 1, cells/frame².
        confinement: Strength of vorticity confinement, dimensionless.
        dissipation: Density that disappears in a frame, as a fraction of what is there.
        erosion: Density that disappears in a frame whatever is there; it keeps edges crisp
            and the smoke sparse.
        drag: Velocity lost in a frame, as a fraction.
    """

    buoyancy: float
    confinement: float
    dissipation: float = 0.008
    erosion: float = 0.003
    drag: float = 0.002


@dataclass
class Smoke:
    """The state of a simulation.

    Attributes:
        density: `[x, y, z]` at cell centres, non-negative.
        faces: Velocity components in cells/frame; `faces[a]` has one more entry along axis `a`,
            entry `i` lying between cells `i - 1` and `i`.
        pressure: What keeps the air from swelling; it knows walls and obstacles.
    """

    density: FloatArray
    faces: list[FloatArray]
    pressure: Pressure = field(default_factory=Pressure)

    @classmethod
    def at_rest(
        cls, shape: Index, opened: Open = CEILING, solid: BoolArray | None = None
    ) -> "Smoke":
        """No smoke and no motion in a box of `shape` cells.

        Args:
            shape: Cells along each axis.
            opened: Which sides of the box are open; all others are walls.
            solid: `[x, y, z]`, cells that an obstacle fills.
        """
        return cls(
            np.zeros(shape, np.float32),
            [np.zeros([n + (a == axis) for a, n in enumerate(shape)], np.float32) for axis in AXES],
            Pressure(opened, solid),
        )

    @property
    def velocity(self) -> FloatArray:
        """`[x, y, z, 3]` at cell centres, cells/frame."""
        return np.stack([_pair_mean(face, axis) for axis, face in enumerate(self.faces)], axis=-1)

    @property
    def divergence(self) -> FloatArray:
        """`[x, y, z]`, 1/frame: net outflow through the faces of each cell."""
        return sum(
            (np.diff(face, axis=axis) for axis, face in enumerate(self.faces)),
            start=np.zeros_like(self.density),
        )

    def accelerate(self, velocity: FloatArray) -> None:
        """Add `[x, y, z, 3]` cells/frame, given at cell centres, to the inner faces."""
        for axis in AXES:
            inner = along(axis, slice(1, -1))
            self.faces[axis][inner] += _pair_mean(velocity[..., axis], axis)


def advance(smoke: Smoke, forces: Forces) -> None:
    """Carry density and velocity along with the flow for one frame, then let both fade."""
    velocity = np.moveaxis(smoke.velocity, -1, 0)
    home = _grid_of(smoke.density)
    # Midpoint rule: in a vortex, half a turn a frame, straight steps would end outside it.
    came, goes = (
        [
            _sampled(component, [x + 0.5 * sign * v for x, v in zip(home, velocity, strict=True)])
            for component in velocity
        ]
        for sign in (-1, 1)
    )
    smoke.density = _carried(smoke.density, came, goes)
    smoke.faces = [
        _carried(face, _at_faces(came, axis), _at_faces(goes, axis))
        for axis, face in enumerate(smoke.faces)
    ]
    if smoke.pressure.solid is not None:
        smoke.density[smoke.pressure.solid] = 0
    smoke.density *= 1 - forces.dissipation
    smoke.density -= forces.erosion
    np.maximum(smoke.density, 0, out=smoke.density)
    for face in smoke.faces:
        face *= 1 - forces.drag


def apply_forces(smoke: Smoke, forces: Forces) -> None:
    """Add one frame of buoyancy and vorticity confinement; `project` comes after."""
    push = _confinement(smoke.velocity) * np.float32(forces.confinement)
    push[..., 2] += forces.buoyancy * smoke.density
    smoke.accelerate(push)


def project(smoke: Smoke) -> None:
    """Remove the divergence of the velocity, and what flows through walls and obstacles."""
    smoke.pressure.close(smoke.faces)
    smoke.pressure.project(smoke.faces, smoke.divergence)


def _carried(
    field: FloatArray, came: Sequence[FloatArray], goes: Sequence[FloatArray]
) -> FloatArray:
    """`field` after one frame of MacCormack advection.

    Args:
        field: At cell centres or at the faces across one axis.
        came: For each axis, how far what arrives at each place has travelled, cells.
        goes: How far what is there now will travel.
    """
    home = _grid_of(field)
    source = [x - step for x, step in zip(home, came, strict=True)]
    target = [x + step for x, step in zip(home, goes, strict=True)]
    moved = _sampled(field, source)
    corrected = moved.copy()
    corrected += 0.5 * (field - _sampled(moved, target))
    # Outside the range of the cells it came from, the correction would invent new extremes.
    corner = tuple(
        np.clip(position, 0, n - 1).astype(np.intp)
        for position, n in zip(source, field.shape, strict=True)
    )
    low, high = (_corners(field, pick)[corner] for pick in (np.minimum, np.maximum))
    np.copyto(corrected, moved, where=(corrected < low) | (corrected > high))
    return corrected


def _grid_of(field: FloatArray) -> tuple[FloatArray, ...]:
    return np.indices(field.shape, dtype=np.float32, sparse=True)


def _sampled(field: FloatArray, at: Sequence[FloatArray]) -> FloatArray:
    from scipy import ndimage

    values = np.empty_like(field)
    ndimage.map_coordinates(field, np.stack(at), output=values, order=1, mode="nearest")
    return values


def _corners(field: FloatArray, pick: np.ufunc) -> FloatArray:
    """The least or greatest of the eight values that trilinear sampling above a cell mixes."""
    for axis in AXES:
        upper = np.concatenate(
            [field[along(axis, slice(1, None))], field[along(axis, slice(-1, None))]], axis
        )
        field = pick(field, upper)
    return field


def _at_faces(centred: Sequence[FloatArray], axis: int) -> list[FloatArray]:
    """Fields at cell centres, averaged to the faces across `axis`."""
    width = [(1, 1) if a == axis else (0, 0) for a in AXES]
    return [_pair_mean(np.pad(field, width, mode="edge"), axis) for field in centred]


def _confinement(velocity: FloatArray) -> FloatArray:
    """N × ω at cell centres, 1/frame: what pushes vortices back to their size."""
    gradient = [np.gradient(velocity[..., component]) for component in AXES]
    vorticity = np.stack(
        [
            gradient[2][1] - gradient[1][2],
            gradient[0][2] - gradient[2][0],
            gradient[1][0] - gradient[0][1],
        ]
    )
    towards = np.stack(np.gradient(np.sqrt(np.sum(vorticity**2, axis=0))))
    towards /= np.sqrt(np.sum(towards**2, axis=0)) + np.float32(1e-6)
    return np.moveaxis(np.cross(towards, vorticity, axis=0), 0, -1)


def _pair_mean(field: FloatArray, axis: int) -> FloatArray:
    lower, upper = along(axis, slice(None, -1)), along(axis, slice(1, None))
    return np.float32(0.5) * (field[lower] + field[upper])
