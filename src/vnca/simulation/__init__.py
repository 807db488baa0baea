"""Simulated smoke for demos, tests and comparisons: a small solver, and scenes."""

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.volume import Volume
from vnca.simulation.obstacles import solid_of
from vnca.simulation.scenes import MIN_RESOLUTION, SCENES, Scene, Stage
from vnca.simulation.solver import Forces, Smoke, advance, apply_forces, project

__all__ = ["SCENES", "Forces", "Smoke", "advance", "apply_forces", "project", "simulate"]


def simulate(
    scene: str,
    *,
    resolution: int,
    frames: int,
    seed: int,
    mesh: tuple[AnyArray, AnyArray] | None = None,
) -> Iterator[Volume]:
    """Simulate a scene from its first puff; one `Volume` a frame, numbered from 1.

    The same arguments give the same bits. Each velocity is the one that carries its own
    frame's density to the next frame.

    Args:
        scene: A name in `SCENES`.
        resolution: Cells in a width; the voxel size is 1 / `resolution`.
        frames: How many frames.
        seed: Of the noise in the sources, not negative.
        mesh: What stands in a scene that needs one: vertices `[n, 3]`, up +z, and triangles
            `[m, 3]`; it is put on the floor, in the middle, half a width high or across.

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
    if SCENES[scene].needs_mesh != (mesh is not None):
        raise OptionError(
            f"`mesh`: the scene {scene} "
            + ("needs one, to stand in the smoke" if mesh is None else "has no place for one")
        )
    stage = Stage(SCENES[scene].size, resolution, seed, SCENES[scene].opened)
    if mesh is not None:
        stage.stand(solid_of(*mesh, stage))
    elif (obstacle := SCENES[scene].obstacle) is not None:
        stage.stand(obstacle(stage))
    return _frames(SCENES[scene], stage, frames)


def _frames(scene: Scene, stage: Stage, frames: int) -> Iterator[Volume]:
    smoke, resolution = stage.smoke, stage.resolution
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
