# ruff: noqa: B905 (the interpreter may be older than this project)
"""Run by a python with pyopenvdb: `openvdb_reads.py FOLDER FILE…` dumps what OpenVDB sees.

Values and active cells of each grid go to FOLDER/NUMBER.npz, all else to FOLDER/NUMBER.json;
grids come sorted by name.
"""

import json
import sys

import numpy as np
import pyopenvdb as vdb

MARGIN, LONGEST = 3, 144  # cells around the active ones, and those looked at along an axis
DENSE, SAMPLES = 2**20, 4000  # beyond so many cells, look at a sample


def dense(grid, low, shape):
    vector = isinstance(grid, vdb.Vec3SGrid)
    array = np.zeros(
        (*shape, 3) if vector else shape, bool if isinstance(grid, vdb.BoolGrid) else np.float32
    )
    grid.copyToArray(array, ijk=low)
    return array


def active_cells(grid, low, shape):
    """OpenVDB has no export of the mask: paint it voxel by voxel and tile by tile."""
    mask = np.zeros(shape, bool)
    for item in grid.citerOnValues():
        spans = zip(item.min, item.max, low)
        mask[tuple(slice(max(0, a - start), max(0, b + 1 - start)) for a, b, start in spans)] = True
    return mask


def look(grid, low, shape):
    """Cells that were looked at (none: all), their values, and whether they are active."""
    if np.prod(shape) <= DENSE:
        return np.empty((0, 3), int), dense(grid, low, shape), active_cells(grid, low, shape)
    cells = np.random.default_rng(0).integers(low, np.add(low, shape), (SAMPLES, 3))
    accessor = grid.getConstAccessor()
    values, active = zip(*(accessor.probeValue(tuple(cell)) for cell in cells.tolist()))
    return cells, np.array(values), np.array(active)


for number, path in enumerate(sys.argv[2:]):
    grids, arrays = [], {}
    for index, grid in enumerate(vdb.readAll(path)[0]):
        low, high = grid.evalActiveVoxelBoundingBox()
        empty = grid.activeVoxelCount() == 0
        start = (0, 0, 0) if empty else tuple(c - MARGIN for c in low)
        stop = (8, 8, 8) if empty else tuple(c + 1 + MARGIN for c in high)
        shape = tuple(min(LONGEST, end - begin) for begin, end in zip(start, stop))
        for part, array in zip(("cells", "values", "active"), look(grid, start, shape)):
            arrays[f"{index}.{part}"] = array
        here = np.array(grid.transform.indexToWorld((0.0, 0.0, 0.0)))
        steps = [np.array(grid.transform.indexToWorld(tuple(row))) - here for row in np.eye(3)]
        grids.append(
            {
                "name": grid.name,
                "box": (start, tuple(a + b for a, b in zip(start, shape))),
                "bounds": None if empty else (low, tuple(c + 1 for c in high)),
                "active_voxels": grid.activeVoxelCount(),
                "background": grid.background,
                "class": grid.gridClass,
                "half": grid.saveFloatAsHalf,
                "memory": grid.memUsage(),
                "matrix": np.stack([*steps, here], axis=1).tolist(),
                "metadata": {k: v for k, v in grid.metadata.items() if not isinstance(v, bytes)},
            }
        )
    np.savez(f"{sys.argv[1]}/{number}.npz", **arrays)
    with open(f"{sys.argv[1]}/{number}.json", "w") as file:
        json.dump(grids, file, default=str)
