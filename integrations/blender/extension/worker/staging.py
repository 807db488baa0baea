# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts the cells of a cache where they belong: adaptive domains, and noise beside its simulation.

Copies of the frames are written, in which every cell lies where it would in a whole domain.
"""

from dataclasses import replace

import vnca
from vnca.io.vdb import Transform

NOISE = "_noise"
"""What the names of grids of noise end with."""


def stage(frames, folder, tell):
    """Write the frames that are not there yet.

    Args:
        frames: As `request.Staged` has them.
        folder: Where to.
        tell: Is told how far it has come.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for done, frame in enumerate(frames):
        tell("progress", what="reading", done=done, total=len(frames), unit="frames")
        path = folder / f"smoke_{frame['number']:04d}.vdb"
        if not path.exists():
            _write(frame, path)


def clear(folder):
    """Remove what was staged, and nothing else."""
    for path in folder.glob("smoke_*.vdb"):
        path.unlink()
    if not any(folder.iterdir()):
        folder.rmdir()


def _write(frame, path):
    first, voxel, finer = frame["first"], frame["voxel"], frame["finer"]
    coarse = Transform.uniform(voxel, [voxel * at for at in first])
    # A cell of the simulation is so many of the noise, with their middle in its own.
    fine = Transform.uniform(voxel / finer, [voxel * (at + 0.5 / finer - 0.5) for at in first])
    grids = []
    with vnca.open_vdb(frame["data"]) as data:
        if frame["noise"] is None:
            grids = [_placed(data, name, coarse) for name in data.grids]
        else:
            with vnca.open_vdb(frame["noise"]) as noise:
                grids = [
                    replace(_placed(noise, name, fine), name=name.removesuffix(NOISE))
                    for name in noise.grids
                ]
                names = {grid.name for grid in grids}
                grids += [_placed(data, name, coarse) for name in data.grids if name not in names]
    vnca.write_vdb(path, grids)


def _placed(file, name, transform):
    return replace(file.read(name), transform=transform)
