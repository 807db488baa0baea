# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies frames that cannot be painted as they are.

Cells of adaptive domains, and of noise beside its simulation, are put where they would lie in a
whole domain. For masks, the density is kept beside the one that will be painted, and a grid tells
which cells are inside a mesh.
"""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import inside
import numpy as np

import vnca
from vnca.io.vdb import Grid, Transform

NOISE = "_noise"
"""What the names of grids of noise end with."""
DENSITY, UNPAINTED, MESH_GRID = "density", "unpainted", "vnca_mask"
RIM = 3
"""Cells around the smoke whose mask is known too, where painted smoke is interpolated."""


def stage(frames, folder, tell, *, mesh=""):
    """Write the frames that are not there yet, or are older than what they are copied from.

    Args:
        frames: As `request.Staged` has them.
        folder: Where to.
        tell: Is told how far it has come.
        mesh: A file of triangles `[n, 3, 3]` in the files' world that mask; empty without.
    """
    triangles = np.load(mesh) if mesh and frames else None
    if frames:
        folder.mkdir(parents=True, exist_ok=True)
    for done, frame in enumerate(frames):
        tell("progress", what="reading", done=done, total=len(frames), unit="frames")
        path = folder / f"smoke_{frame['number']:04d}.vdb"
        sources = [Path(frame[name]) for name in ("data", "noise") if frame[name] is not None]
        if not (path.exists() and all(_age(path) > _age(source) for source in sources)):
            _write(frame, path, triangles)


def clear(folder):
    """Remove what was staged, and nothing else."""
    for path in folder.glob("smoke_*.vdb"):
        path.unlink()
    if folder.exists() and not any(folder.iterdir()):
        folder.rmdir()


def _age(path):
    return path.stat().st_mtime_ns if path.exists() else 0


def _write(frame, path, triangles):
    with ExitStack() as files:
        data = files.enter_context(vnca.open_vdb(frame["data"]))
        if frame["first"] is None:
            grids = list(data.grids.values())
        else:
            noise = frame["noise"] and files.enter_context(vnca.open_vdb(frame["noise"]))
            grids = _in_place(frame, data, noise)
        if frame["keeps"] and (density := _density(grids)) is not None:
            grids.append(replace(density, name=UNPAINTED))
            if triangles is not None:
                grids.append(_mask(density, triangles))
        vnca.write_vdb(path, grids, metadata=data.metadata)


def _in_place(frame, data, noise):
    """The grids of a frame of a cache, with their cells where they belong."""
    first, voxel, finer = frame["first"], frame["voxel"], frame["finer"]
    coarse = Transform.uniform(voxel, [voxel * at for at in first])
    if not noise:
        return [_placed(data, name, coarse) for name in data.grids]
    # A cell of the simulation is so many of the noise, with their middle in its own.
    fine = Transform.uniform(voxel / finer, [voxel * (at + 0.5 / finer - 0.5) for at in first])
    grids = [
        replace(_placed(noise, name, fine), name=name.removesuffix(NOISE)) for name in noise.grids
    ]
    names = {grid.name for grid in grids}
    return grids + [_placed(data, name, coarse) for name in data.grids if name not in names]


def _density(grids):
    """The density with its values; None where the frame has no smoke."""
    found = next((grid for grid in grids if grid.name == DENSITY), None)
    if found is not None and not isinstance(found, Grid):
        found = found.read()
    return None if found is None or found.active_box().is_empty else found


def _mask(density, triangles):
    """1 in cells whose middle is inside the mesh, on the cells of the density and a rim."""
    box = density.active_box().grown(RIM)
    values = inside.cells(triangles, box, density.transform.index_to_world).astype(np.float32)
    return Grid.from_dense(MESH_GRID, values, values > 0, box.lower, transform=density.transform)


def _placed(file, name, transform):
    return replace(file.read(name), transform=transform)
