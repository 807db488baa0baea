"""A small smoke solver (MacCormack advection, exact pressure), and scenes for demos and tests.

The grid is staggered (MAC): density sits at cell centres, each velocity component on the faces
across its axis, with one more face than cells. Floor and side walls are closed, the ceiling is
open. Lengths are in cells, times in frames; one step is one frame. Lengths of scenes are written
in widths, one width being `resolution` cells, so that a scene looks the same at every resolution.

Reference: Fedkiw, Stam and Jensen 2001 (buoyancy, vorticity confinement); Selle et al. 2008
(MacCormack advection with a limiter).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from vnca.core import AnyArray, FloatArray, Index
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.volume import Volume

AXES = (0, 1, 2)


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
    """

    density: FloatArray
    faces: list[FloatArray]

    @classmethod
    def at_rest(cls, shape: Index) -> "Smoke":
        """No smoke and no motion in a box of `shape` cells."""
        return cls(
            np.zeros(shape, np.float32),
            [np.zeros([n + (a == axis) for a, n in enumerate(shape)], np.float32) for axis in AXES],
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
            inner = _along(axis, slice(1, -1))
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
    """Remove the divergence of the velocity, exactly in this discretisation.

    The seven-point Laplacian with closed walls is diagonal in the cosine basis of type
    II; along z, closed below and open above, in the one of type IV.
    """
    from scipy import fft

    faces = smoke.faces
    for axis in AXES:
        faces[axis][_along(axis, 0)] = 0
    for axis in (0, 1):
        faces[axis][_along(axis, -1)] = 0
    x, y, z = (np.arange(n, dtype=np.float32) for n in smoke.density.shape)
    spectrum = np.asarray(fft.dctn(smoke.divergence, type=2, axes=(0, 1), norm="ortho"))
    spectrum = np.asarray(fft.dct(spectrum, type=4, axis=2, norm="ortho"))
    spectrum /= (
        _eigenvalue(x, len(x))[:, None, None]
        + _eigenvalue(y, len(y))[:, None]
        + _eigenvalue(z + 0.5, len(z))
    )
    pressure = fft.idct(spectrum, type=4, axis=2, norm="ortho")
    pressure = np.asarray(fft.idctn(pressure, type=2, axes=(0, 1), norm="ortho"))
    for axis in AXES:
        faces[axis][_along(axis, slice(1, -1))] -= np.diff(pressure, axis=axis)
    # The pressure is zero half a cell above the ceiling's face: odd about it.
    faces[2][..., -1] += 2 * pressure[..., -1]


def _eigenvalue(wave: FloatArray, cells: int) -> FloatArray:
    return 2 * np.cos(np.pi / cells * wave, dtype=np.float32) - 2


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
            [field[_along(axis, slice(1, None))], field[_along(axis, slice(-1, None))]], axis
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
    lower, upper = _along(axis, slice(None, -1)), _along(axis, slice(1, None))
    return np.float32(0.5) * (field[lower] + field[upper])


def _along(axis: int, index: int | slice) -> tuple[int | slice, ...]:
    return tuple(index if a == axis else slice(None) for a in AXES)


MIN_RESOLUTION = 8


class Stage:
    """The box of a scene, and the seeded noise its sources flicker with.

    Attributes:
        resolution: Cells in a width.
        x: `[x, 1, 1]`, widths from the middle of the box.
        y: `[1, y, 1]`, widths from the middle of the box.
        z: `[1, 1, z]`, widths above the floor.
    """

    def __init__(self, size: tuple[float, float, float], resolution: int, seed: int) -> None:
        self.resolution = resolution
        self.smoke = Smoke.at_rest(
            (round(size[0] * resolution), round(size[1] * resolution), round(size[2] * resolution))
        )
        shape = self.smoke.density.shape
        x, y, z = ((np.arange(n, dtype=np.float32) + 0.5) / resolution for n in shape)
        self.x = (x - x.mean())[:, None, None]
        self.y = (y - y.mean())[None, :, None]
        self.z = z[None, None, :]
        self._random = np.random.default_rng(seed)
        self._noise: dict[str, FloatArray] = {}

    def noise(self, name: str, *, size: float, memory: float) -> FloatArray:
        """Smooth noise with mean 0 and deviation 1 that changes from call to call.

        Args:
            name: A process of its own for every name; one call a frame.
            size: Length over which it varies, widths.
            memory: Correlation from one call to the next, in [0, 1).

        Returns:
            `[x, y, z]`.
        """
        from scipy import ndimage

        white = self._random.standard_normal(self.smoke.density.shape, np.float32)
        sigma = size * self.resolution
        noise = np.asarray(ndimage.gaussian_filter(white, sigma, mode="wrap", truncate=3))
        noise /= noise.std()
        if name in self._noise:
            noise = memory * self._noise[name] + math.sqrt(1 - memory**2) * noise
        self._noise[name] = noise
        return noise

    def emit_density(self, where: FloatArray, density: FloatArray) -> None:
        """Raise the density to `density`, at most 1, as far as `where` (0 to 1) says."""
        smoke = self.smoke
        smoke.density = np.maximum(smoke.density, where * np.clip(density, 0, 1))

    def emit_velocity(self, where: FloatArray, *velocity: FloatArray | float) -> None:
        """Bring the velocity to x, y, z in widths/frame, as far as `where` (0 to 1) says."""
        wanted = np.stack(np.broadcast_arrays(*velocity), axis=-1) * np.float32(self.resolution)
        self.smoke.accelerate(where[..., None] * (wanted - self.smoke.velocity))


def _soft(distance: AnyArray, edge: float) -> FloatArray:
    """1 inside (negative distance), 0 outside, with a ramp of two `edge` between."""
    ramp = np.clip(0.5 - 0.5 * distance / edge, 0, 1).astype(np.float32)
    return ramp * ramp * (3 - 2 * ramp)


def _plume(stage: Stage, frame: int) -> None:
    """A hot, uneven disc on the floor."""
    heat = stage.noise("heat", size=0.04, memory=0.8)
    sway = [stage.noise(axis, size=0.05, memory=0.8) for axis in "xy"]
    where = _soft(np.maximum(np.hypot(stage.x, stage.y) - 0.16, stage.z - 0.06), 0.03)
    stage.emit_density(where, 0.8 + 0.25 * heat)
    stage.emit_velocity(where, 0.012 * sway[0], 0.012 * sway[1], 0.04 + 0.012 * heat)


def _jets(stage: Stage, frame: int) -> None:
    """Two jets, nearly head on, that burst into a sheet."""
    sway = [stage.noise(axis, size=0.05, memory=0.85) for axis in "xyz"]
    for side in (-1, 1):
        height = stage.z - 0.42 + 0.025 * side
        disc = np.hypot(stage.y, height) - 0.075
        where = _soft(np.maximum(disc, np.abs(stage.x - side * 0.6) - 0.05), 0.03)
        stage.emit_density(where, 0.85 + 0.2 * sway[0])
        speed = -side * (0.06 + 0.01 * sway[0])
        stage.emit_velocity(where, speed, 0.008 * sway[1], 0.008 * sway[2])


def _ring(stage: Stage, frame: int) -> None:
    """A puff through a round opening, again and again: each rolls up into a ring and rises."""
    uneven = stage.noise("puff", size=0.06, memory=0.9)
    if (frame - 1) % 32 >= 6:
        return
    radius = np.hypot(stage.x, stage.y)
    height = np.abs(stage.z - 0.14) - 0.07
    torus = _soft(np.hypot(radius - 0.19, stage.z - 0.15) - 0.08, 0.03)
    opening = _soft(np.maximum(radius - 0.2, height), 0.06)
    stage.emit_density(torus, 0.9 + 0.15 * uneven)
    stage.emit_velocity(opening, 0, 0, 0.1 + 0.005 * uneven)


@dataclass(frozen=True)
class Scene:
    """A box, its forces and its source.

    Attributes:
        size: Widths along x, y and z.
        forces: Accelerations in widths/frame², the rest as in `Forces`.
        emit: Called before each frame with the frame number, from 1.
    """

    size: tuple[float, float, float]
    forces: Forces
    emit: Callable[[Stage, int], None]


SCENES = {
    "plume": Scene((1, 1, 1.5), Forces(buoyancy=0.011, confinement=0.1), _plume),
    "jets": Scene((1.5, 1, 1), Forces(buoyancy=0.001, confinement=0.1), _jets),
    "ring": Scene((1, 1, 1.5), Forces(buoyancy=0.0003, confinement=0.05), _ring),
}


def simulate(scene: str, *, resolution: int, frames: int, seed: int) -> Iterator[Volume]:
    """Simulate a scene from its first puff; one `Volume` a frame, numbered from 1.

    The same arguments give the same bits. Each velocity is the one that carries its own
    frame's density to the next frame.

    Args:
        scene: A name in `SCENES`.
        resolution: Cells in a width; the voxel size is 1 / `resolution`.
        frames: How many frames.
        seed: Of the noise in the sources, not negative.

    Raises:
        OptionError: If there is no such scene, or a number is out of its range.
        BackendUnavailableError: If scipy is not installed.
    """
    if scene not in SCENES:
        raise OptionError(f"scene: expected one of {', '.join(SCENES)}, got {scene!r}")
    if resolution < MIN_RESOLUTION:
        raise OptionError(f"resolution: expected at least {MIN_RESOLUTION}, got {resolution}")
    if frames < 1:
        raise OptionError(f"frames: expected at least 1, got {frames}")
    if seed < 0:
        raise OptionError(f"seed: expected 0 or more, got {seed}")
    if find_spec("scipy") is None:
        raise BackendUnavailableError(
            "simulating needs scipy, which is not installed: pip install 'vnca[train]'"
        )
    return _frames(SCENES[scene], resolution, frames, seed)


def _frames(scene: Scene, resolution: int, frames: int, seed: int) -> Iterator[Volume]:
    stage = Stage(scene.size, resolution, seed)
    smoke = stage.smoke
    forces = replace(scene.forces, buoyancy=scene.forces.buoyancy * resolution)
    for frame in range(1, frames + 1):
        scene.emit(stage, frame)
        apply_forces(smoke, forces)
        project(smoke)
        yield Volume(
            density=smoke.density.copy(),
            velocity=smoke.velocity,
            origin=(0, 0, 0),
            index_to_world=np.diag([1 / resolution] * 3 + [1.0]),
            frame=frame,
        )
        advance(smoke, forces)
