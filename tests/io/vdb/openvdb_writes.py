"""Run by a python with pyopenvdb: `openvdb_writes.py FOLDER` writes a file a variant."""

import random
import sys

import pyopenvdb as vdb

random.seed(1)
folder = sys.argv[1]


def scattered(grid, value):
    accessor = grid.getAccessor()
    for _ in range(200):
        accessor.setValueOn(tuple(random.randrange(-12, 40) for _ in range(3)), value())
    return grid


def number():
    return random.uniform(-3, 3)


def vector():
    return tuple(random.uniform(-3, 3) for _ in range(3))


def save(name, *grids, **options):
    vdb.write(f"{folder}/{name}.vdb", list(grids), **options)


def named(name, grid):
    grid.name = name
    return grid


save("float", named("float", scattered(vdb.FloatGrid(0.5), number)))
save("vec3s", named("vec3s", scattered(vdb.Vec3SGrid((1, 2, 3)), vector)))
save("bool", named("bool", scattered(vdb.BoolGrid(), lambda: random.random() < 0.5)))
save("bool_true", named("bool_true", scattered(vdb.BoolGrid(True), lambda: random.random() < 0.5)))

for kind, value in ((vdb.FloatGrid, number), (vdb.Vec3SGrid, vector)):
    grid = named("half", scattered(kind(), value))
    grid.saveFloatAsHalf = True
    save(f"half_{kind.__name__}", grid)

# Every level of tile, active and not.
grid = named("tiles", vdb.FloatGrid(0.25))
grid.fill((0, 0, 0), (39, 47, 55), 1.5, True)
grid.fill((80, 0, 0), (127, 47, 55), 2.5, False)
grid.fill((128, 0, 0), (255, 127, 127), 3.5, True)
grid.fill((-256, 0, 0), (-1, 255, 255), 4.5, False)
save("tiles", grid)
grid = named("root_tiles", vdb.FloatGrid(0.25))
grid.fill((0, 0, 0), (4095, 4095, 4095), 1.5, True)
grid.fill((-4096, 0, 0), (-1, 4095, 4095), 2.5, False)
save("root_tiles", grid)

# Each way of omitting inactive values, in a leaf, in a lower and in an upper node.
ways = [(3.0,), (-3.0,), (7.0,), (3.0, -3.0), (3.0, 7.0), (5.0, 7.0), (5.0, 6.0, 7.0)]
grids = []
for way, inactive in enumerate(ways):
    grid = named(f"way {way}", vdb.FloatGrid(3.0))
    accessor = grid.getAccessor()
    count = len(inactive)
    for x in range(0, 4096, 128):  # the other children of the upper node
        for y in range(0, 4096, 128):
            for z in range(0, 4096, 128):
                value = inactive[(x + y + z) // 128 % count]
                if value != 3.0:
                    grid.fill((x, y, z), (x + 127, y + 127, z + 127), value, False)
    for k in range(4096):  # of the lower node
        low = tuple(8 * part for part in (k >> 8, k >> 4 & 15, k & 15))
        grid.fill(low, tuple(part + 7 for part in low), inactive[k % count], False)
    for k in range(512):  # and the cells of a leaf
        accessor.setValueOff((k >> 6, k >> 3 & 7, k & 7), inactive[k % count])
    for k in range(0, 512, 37):
        accessor.setValueOn((k >> 6, k >> 3 & 7, k & 7), float(k))
    accessor.setValueOn((200, 130, 100), 1.0)
    grids.append(grid)
save("omitted", *grids)

save("level_set", named("sphere", vdb.createLevelSetSphere(2.0, voxelSize=0.25)))
save("empty", named("empty", vdb.FloatGrid(1.5)))

transforms = {
    "uniform": vdb.createLinearTransform(voxelSize=0.25),
    "affine": vdb.createLinearTransform(
        [[1, 2, 0, 0], [0, 1, 0.5, 0], [0.25, 0, 2, 0], [4, 5, 6, 1]]
    ),
    "scale": vdb.createLinearTransform([[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 3, 0], [0, 0, 0, 1]]),
}
transforms["scale_translate"] = vdb.createLinearTransform(
    [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 3, 0], [4, 5, 6, 1]]
)
transforms["uniform_translate"] = vdb.createLinearTransform(voxelSize=0.5)
transforms["uniform_translate"].translate((1.0, 2.0, 3.0))
transforms["rotated"] = vdb.createLinearTransform(voxelSize=0.5)
transforms["rotated"].rotate(0.3, vdb.Axis.Y)
grids = []
for name, transform in transforms.items():
    grid = named(name, scattered(vdb.FloatGrid(), number))
    grid.transform = transform
    grids.append(grid)
save("transforms", *grids)

frustum = named("frustum", scattered(vdb.FloatGrid(), number))
frustum.transform = vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 10.0)
save("frustum", frustum, named("density", scattered(vdb.FloatGrid(), number)))

# Grids of one name, without a name, and sharing a tree.
shared = named("shared", scattered(vdb.FloatGrid(), number))
sharing = shared.copy()
sharing.name = "sharing"
sharing.transform = transforms["scale_translate"]
save(
    "several",
    named("density", scattered(vdb.FloatGrid(), number)),
    named("density", scattered(vdb.Vec3SGrid(), vector)),
    scattered(vdb.FloatGrid(), number),
    shared,
    sharing,
    metadata={"title": "Übung", "count": 7, "scale": 0.5, "where": (1, 2, 3)},
)

# Smoke in small cells, and a wind that is its place in the world, in large and turned ones.
smoke = named("density", vdb.FloatGrid())
smoke.transform = vdb.createLinearTransform(voxelSize=0.1)
smoke.fill((0, 0, 0), (7, 7, 7), 1.0, True)
large = vdb.createLinearTransform(voxelSize=0.25)
large.rotate(0.3, vdb.Axis.Y)
large.translate((0.3, 0.2, 0.1))
cells = [(i, j, k) for i in range(-6, 7) for j in range(-6, 7) for k in range(-6, 7)]
wind = named("Velocity", vdb.Vec3SGrid())
parts = [named(f"Velocity{axis}", vdb.FloatGrid()) for axis in "XYZ"]
for cell in cells:
    place = large.indexToWorld(cell)
    wind.getAccessor().setValueOn(cell, place)
    for part, value in zip(parts, place, strict=True):
        part.getAccessor().setValueOn(cell, value)
for grid in (wind, *parts):
    grid.transform = large
save("wind", smoke, wind)
bent = named("vel", wind.deepCopy())
bent.transform = vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 10.0)
save("wind_bent", smoke, bent)
save("wind_parts", smoke, *parts)
