"""Scenes of smoke: boxes, their sources and what stands in them.

Lengths are in widths, one width being `resolution` cells, so that a scene looks the same at every
resolution.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray, BoolArray, FloatArray
from vnca.core.errors import OptionError
from vnca.simulation.pressure import ALL_OPEN, CEILING, Open, Pressure
from vnca.simulation.solver import Forces, Smoke

MIN_RESOLUTION = 8


class Stage:
    """The box of a scene, and the seeded noise its sources flicker with.

    Attributes:
        resolution: Cells in a width.
        x: `[x, 1, 1]`, widths from the middle of the box.
        y: `[1, y, 1]`, widths from the middle of the box.
        z: `[1, 1, z]`, widths above the floor.
    """

    def __init__(
        self,
        size: tuple[float, float, float],
        resolution: int,
        seed: int,
        opened: Open = CEILING,
    ) -> None:
        self.resolution = resolution
        shape = (
            round(size[0] * resolution),
            round(size[1] * resolution),
            round(size[2] * resolution),
        )
        self.smoke = Smoke.at_rest(shape, opened)
        x, y, z = ((np.arange(n, dtype=np.float32) + 0.5) / resolution for n in shape)
        self.x = (x - x.mean())[:, None, None]
        self.y = (y - y.mean())[None, :, None]
        self.z = z[None, None, :]
        self._random = np.random.default_rng(seed)
        self._noise: dict[str, FloatArray] = {}

    def stand(self, solid: BoolArray) -> None:
        """Put an obstacle into the box, `[x, y, z]`; smoke flows around it.

        Raises:
            OptionError: If it fills the box, or does not fit it.
        """
        smoke = self.smoke
        if solid.shape != smoke.density.shape or solid.all():
            raise OptionError(
                f"obstacle: expected some of {smoke.density.shape} cells, got {solid.shape}"
                + (", all of them" if solid.all() else "")
            )
        self.smoke = Smoke(smoke.density, smoke.faces, Pressure(smoke.pressure.opened, solid))

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


def _jet(stage: Stage, frame: int) -> None:
    """A ball near one side that blows across: the paper's Smoke Jet, 4 of 200 cells a frame."""
    ball = np.sqrt((stage.x + 0.3) ** 2 + stage.y**2 + (stage.z - 0.225) ** 2)
    where = (ball < 0.12).astype(np.float32)
    stage.emit_density(where, np.ones((), np.float32))
    stage.emit_velocity(where, 0.02, 0, 0)


def _sphere(stage: Stage, frame: int) -> None:
    """A hot ball under a solid one."""
    heat = stage.noise("heat", size=0.05, memory=0.9)
    ball = np.sqrt(stage.x**2 + stage.y**2 + (stage.z - 0.2) ** 2)
    where = _soft(ball - 0.125, 0.02)
    stage.emit_density(where, 0.95 + 0.05 * heat)
    stage.emit_velocity(where, 0, 0, 0.046 + 0.005 * heat)


def _bunny(stage: Stage, frame: int) -> None:
    """A broad, uneven bed of smoke under what stands in the box."""
    heat = stage.noise("heat", size=0.06, memory=0.85)
    where = _soft(np.maximum(np.hypot(stage.x, stage.y) - 0.3, stage.z - 0.05), 0.03)
    stage.emit_density(where, 0.7 + 0.3 * heat)
    stage.emit_velocity(where, 0, 0, 0.03 + 0.012 * heat)


def _billowy(stage: Stage, frame: int) -> None:
    """Several hot spots on a broad disc, which wander: smoke that boils up in heaps."""
    heat = stage.noise("heat", size=0.08, memory=0.95)
    grain = stage.noise("grain", size=0.025, memory=0.8)
    where = _soft(np.maximum(np.hypot(stage.x, stage.y) - 0.28, stage.z - 0.07), 0.03)
    spots: FloatArray = np.clip(0.6 + 0.5 * heat, 0, 1).astype(np.float32)
    where = (where * spots).astype(np.float32)
    stage.emit_density(where, 0.85 + 0.2 * grain)
    speed = (0.03 + 0.02 * heat + 0.01 * grain).astype(np.float32)
    stage.emit_velocity(where, 0, 0, speed)


def _ball(stage: Stage) -> BoolArray:
    return np.sqrt(stage.x**2 + stage.y**2 + (stage.z - 0.72) ** 2) < 0.12


@dataclass(frozen=True)
class Scene:
    """A box, its forces, its source, and what stands in it.

    Attributes:
        size: Widths along x, y and z.
        forces: Accelerations in widths/frame², the rest as in `Forces`.
        emit: Called before each frame with the frame number, from 1.
        opened: Which sides are open; all others are walls.
        obstacle: What stands in the box, `[x, y, z]`; None for nothing.
        needs_mesh: Whether a mesh of the user's stands in it.
    """

    size: tuple[float, float, float]
    forces: Forces
    emit: Callable[[Stage, int], None]
    opened: Open = CEILING
    obstacle: Callable[[Stage], BoolArray] | None = None
    needs_mesh: bool = False


SCENES = {
    "plume": Scene((1, 1, 1.5), Forces(buoyancy=0.011, confinement=0.1), _plume),
    "jets": Scene((1.5, 1, 1), Forces(buoyancy=0.001, confinement=0.1), _jets),
    "ring": Scene((1, 1, 1.5), Forces(buoyancy=0.0003, confinement=0.05), _ring),
    "jet": Scene(
        (1, 1, 1.5),
        # 4·10⁻³ in the paper's scene, over the width of a cell, as Mantaflow has it: 0.3 cells
        # a frame² at 200 cells.
        Forces(buoyancy=0.0015, confinement=0.05, dissipation=0, erosion=0, drag=0),
        _jet,
        ALL_OPEN,
    ),
    "sphere": Scene(
        (1, 1, 1.5), Forces(buoyancy=0.004, confinement=0.05), _sphere, ALL_OPEN, _ball
    ),
    "billowy": Scene(
        (1.25, 1.25, 1.5), Forces(buoyancy=0.003, confinement=0.2), _billowy, ALL_OPEN
    ),
    "bunny": Scene(
        (1, 1, 1.5), Forces(buoyancy=0.008, confinement=0.12), _bunny, CEILING, needs_mesh=True
    ),
}
