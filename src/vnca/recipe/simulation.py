"""Smoke to play with: a scene simulated into files or volumes."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from vnca.core.errors import OptionError
from vnca.core.files import writable_folder
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.recipe import SILENT, Watch, tracked
from vnca.simulation import simulate as simulated_frames

Scene = Literal["plume", "jets", "ring"]


@dataclass(frozen=True, kw_only=True)
class SimulateRun:
    """A simulation of a scene."""

    scene: Scene
    """A rising plume, two colliding jets, or a rising vortex ring."""
    out: Path | None
    """Folder for the frames, named SCENE_0001.vdb and on."""
    resolution: int = 48
    """Cells across the scene."""
    frames: int = 40
    """How many frames."""
    seed: int = 0
    """Same seed, same machine, same smoke."""

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise OptionError(f"`frames` {self.frames}: at least 1 is needed")


def simulate(
    scene: Scene,
    *,
    out: str | Path | None = None,
    resolution: int = 48,
    frames: int = 40,
    seed: int = 0,
    watch: Watch = SILENT,
) -> Iterator[Volume]:
    """Simulate smoke, one frame each time the iterator is asked for the next.

    Args:
        scene: `plume`, `jets` or `ring`.
        out: Folder for the frames, named SCENE_0001.vdb and on; nothing is written unless given.
        resolution: Cells across the scene.
        frames: How many.
        seed: Same seed, same machine, same smoke.
        watch: Is told how far it has come, and may cancel.

    Yields:
        Density, and velocity in cells a frame.

    Raises:
        VncaError: If the scene cannot be simulated or the folder cannot be written.
    """
    run = SimulateRun(
        scene=scene,
        out=None if out is None else Path(out),
        resolution=resolution,
        frames=frames,
        seed=seed,
    )
    if run.out is not None:
        writable_folder(run.out)
    volumes = simulated_frames(scene, resolution=resolution, frames=frames, seed=seed)
    return _written(tracked(volumes, watch, "simulating", frames, "frames"), run, watch)


def _written(volumes: Iterator[Volume], run: SimulateRun, watch: Watch) -> Iterator[Volume]:
    for volume in volumes:
        if run.out is not None:
            write_smoke(run.out / f"{run.scene}_{volume.frame:04d}.vdb", volume)
        yield volume
    if run.out is not None:
        watch.made("smoke", run.out)
