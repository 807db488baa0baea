"""Smoke to play with: a scene simulated into files or volumes."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import OptionError
from vnca.core.files import writable_folder
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.recipe import SILENT, Watch, tracked
from vnca.simulation import simulate as simulated_frames

Scene = Literal["plume", "jets", "ring", "jet", "sphere", "billowy", "bunny"]
PRESETS = {"paper": (200, 120)}
"""Resolution and frames of the paper's scene, the jet."""
RESOLUTION, FRAMES = 48, 40


@dataclass(frozen=True, kw_only=True)
class SimulateRun:
    """A simulation of a scene."""

    scene: Scene
    """A rising plume, two colliding jets, a rising vortex ring; the paper's jet, a plume against a
    sphere, billowy smoke, or smoke around a mesh (bunny)."""
    out: Path | None
    """Folder for the frames, named SCENE_0001.vdb and on."""
    preset: Literal["paper"] | None = None
    """The jet as the paper has it: 200 cells across, 300 high, 120 frames."""
    resolution: int | None = None
    """Cells across the scene; 48 unless given, or those of the preset."""
    frames: int | None = None
    """How many frames; 40 unless given, or those of the preset."""
    mesh: Path | None = None
    """What stands in the smoke of the scene bunny: OBJ, PLY or GLB."""
    seed: int = 0
    """Same seed, same machine, same smoke."""

    def __post_init__(self) -> None:
        if self.frames is not None and self.frames < 1:
            raise OptionError(f"`frames` {self.frames}: at least 1 is needed")
        if self.preset is not None and self.scene != "jet":
            raise OptionError(f"`preset` {self.preset}: is of the scene jet, not of {self.scene}")

    @property
    def size(self) -> tuple[int, int]:
        """Cells across, and frames."""
        cells, frames = (RESOLUTION, FRAMES) if self.preset is None else PRESETS[self.preset]
        return self.resolution or cells, self.frames or frames


def simulate(
    scene: Scene,
    *,
    out: str | Path | None = None,
    preset: Literal["paper"] | None = None,
    resolution: int | None = None,
    frames: int | None = None,
    mesh: str | Path | None = None,
    seed: int = 0,
    watch: Watch = SILENT,
) -> Iterator[Volume]:
    """Simulate smoke, one frame each time the iterator is asked for the next.

    Args:
        scene: `plume`, `jets`, `ring`, `jet`, `sphere`, `billowy` or `bunny`.
        out: Folder for the frames, named SCENE_0001.vdb and on; nothing is written unless given.
        preset: `paper`, of the jet: 200 cells across and 120 frames.
        resolution: Cells across the scene; 48 unless given, or those of the preset.
        frames: How many; 40 unless given, or those of the preset.
        mesh: What stands in the smoke of the scene `bunny`.
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
        preset=preset,
        resolution=resolution,
        frames=frames,
        mesh=None if mesh is None else Path(mesh),
        seed=seed,
    )
    if run.out is not None:
        writable_folder(run.out)
    cells, count = run.size
    volumes = simulated_frames(
        scene, resolution=cells, frames=count, seed=seed, mesh=_solid(run.mesh)
    )
    return _written(tracked(volumes, watch, "simulating", count, "frames"), run, watch)


def _solid(path: Path | None) -> tuple[AnyArray, AnyArray] | None:
    """Vertices, up +z, and triangles of a mesh in a file."""
    if path is None:
        return None
    # Reading OBJ and PLY takes trimesh, which no other scene needs.
    from vnca.io.mesh import read_mesh

    surfaces = read_mesh(path).surfaces
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    faces = [surface.faces + start for surface, start in zip(surfaces, starts, strict=False)]
    return np.concatenate([surface.points for surface in surfaces]), np.concatenate(faces)


def _written(volumes: Iterator[Volume], run: SimulateRun, watch: Watch) -> Iterator[Volume]:
    for volume in volumes:
        if run.out is not None:
            write_smoke(run.out / f"{run.scene}_{volume.frame:04d}.vdb", volume)
        yield volume
    if run.out is not None:
        watch.made("smoke", run.out)
