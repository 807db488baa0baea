"""Run by a python with pyopenvdb: `openvdb_turns.py FOLDER` writes one smoke in several grids.

OpenVDB itself says which cell of a grid lies at a place of the world.
"""

import sys
from itertools import product

import pyopenvdb as vdb

folder = sys.argv[1]
SIZE = 0.25


def rows(x, y, z, t=(0.0, 0.0, 0.0)):
    """A transform that takes the axes of cells to these directions of the world."""
    scaled = [[SIZE * part for part in axis] + [0.0] for axis in (x, y, z)]
    return vdb.createLinearTransform([*scaled, [*t, 1.0]])


TURNS = {
    "plain": rows((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "moved": rows((1, 0, 0), (0, 1, 0), (0, 0, 1), (5.0, -2.5, 0.25)),
    "mirrored": rows((-1, 0, 0), (0, 1, 0), (0, 0, 1), (1.5, 0.0, 0.0)),
    "exchanged": rows((0, 0, 1), (0, 1, 0), (1, 0, 0)),
    "turned": rows((0, 1, 0), (-1, 0, 0), (0, 0, 1), (0.0, 0.0, -3.0)),
    "all": rows((0, 0, -1), (-1, 0, 0), (0, -1, 0), (0.5, 7.0, 1.0)),
}
turned = vdb.createLinearTransform(voxelSize=SIZE)
turned.rotate(0.5, vdb.Axis.X)
turned.translate((0.0, 1.0, 0.0))
TURNS["slanted"] = turned


def places():
    for cell in product(range(-6, 7), repeat=3):
        if sum(part * part for part in cell) <= 36:
            yield tuple(SIZE * part for part in cell)


for name, transform in TURNS.items():
    density, velocity = vdb.FloatGrid(), vdb.Vec3SGrid()
    density.name, velocity.name = "density", "vel"
    density.transform = velocity.transform = transform
    stores = density.getAccessor(), velocity.getAccessor()
    for place in places():
        x, y, z = place
        cell = tuple(transform.worldToIndexCellCentered(place))
        stores[0].setValueOn(cell, 1.0 + 0.1 * x - 0.07 * y + 0.05 * z)
        stores[1].setValueOn(cell, (1.0 + x, 2.0 - z, 3.0 + y))
    vdb.write(f"{folder}/{name}.vdb", [density, velocity])
