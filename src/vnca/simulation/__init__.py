"""Scenes for demos and tests: what is emitted where, and how the air pushes back.

Lengths are written in widths, one width being `resolution` cells, so that a scene looks the same
at every resolution; frames are frames.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.typing import AnyArray, FloatArray
from vnca.core.volume import Volume
from vnca.simulation.solver import Forces, Smoke, advance, apply_forces, project

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
