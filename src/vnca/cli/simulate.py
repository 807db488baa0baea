"""`vnca simulate SCENE --out DIR`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from vnca.cli.options import parse
from vnca.cli.progress import made, tracked
from vnca.core.errors import OptionError
from vnca.core.files import writable_folder
from vnca.io.smoke import write_smoke
from vnca.simulation.scenes import simulate


@dataclass(frozen=True)
class Simulate:
    """Write a smoke simulation: density and velocity (cells/frame), an OpenVDB file a frame."""

    scene: tyro.conf.Positional[Literal["plume", "jets", "ring"]]
    """A rising plume, two colliding jets, or a rising vortex ring."""
    out: Path
    """Folder for the frames, named SCENE_0001.vdb and on."""
    resolution: int = 48
    """Cells across the scene."""
    frames: int = 40
    """How many frames."""
    seed: int = 0
    """Same seed, same machine, same smoke."""

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise OptionError(f"--frames {self.frames}: at least 1 is needed")


def run(arguments: Sequence[str]) -> None:
    """Read the options and simulate."""
    write_simulation(parse("simulate", Simulate, arguments))


def write_simulation(options: Simulate) -> None:
    """Simulate as asked, writing each frame as it is done.

    Raises:
        VncaError: If the scene cannot be simulated or the folder cannot be written.
    """
    writable_folder(options.out)
    volumes = simulate(
        options.scene, resolution=options.resolution, frames=options.frames, seed=options.seed
    )
    for volume in tracked(volumes, "simulating", options.frames, "frames"):
        write_smoke(options.out / f"{options.scene}_{volume.frame:04d}.vdb", volume)
    made("smoke", options.out)
