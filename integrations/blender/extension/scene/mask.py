# SPDX-License-Identifier: GPL-3.0-or-later
"""Where smoke is painted: inside an object, or by a grid of the files."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..problem import ProblemError
from ..request import Placement, Smoke

MESH_GRID = "vnca_mask"
"""The grid that is 1 inside a mesh, and gets into painted files; the worker calls it so, too."""
UNPAINTED = "unpainted"
"""The grid of the density as it was; the worker calls it so, too."""


def is_wanted(settings: bpy.types.PropertyGroup) -> bool:
    """Whether there is a mask, and what it is made of."""
    if settings.mask == "GRID":
        return bool(settings.mask_grid)
    return settings.mask != "NONE" and settings.mask_object is not None


def grid_of(settings: bpy.types.PropertyGroup) -> str:
    """The grid of the files that masks; empty where none does."""
    return {"GRID": settings.mask_grid, "MESH": MESH_GRID}.get(settings.mask, "")


def shape_of(settings: bpy.types.PropertyGroup, smoke: Smoke) -> dict[str, Any]:
    """The mask as the worker is told of it, to draw its pictures by.

    Args:
        settings: Of the scene.
        smoke: What is painted.
    """
    if not is_wanted(settings):
        return {"kind": "NONE"}
    if grid := grid_of(settings):
        return {"kind": "GRID", "grid": grid}
    to_shape = settings.mask_object.matrix_world.inverted_safe() @ _world_of(settings, smoke)
    return {"kind": settings.mask, "matrix": [list(row) for row in to_shape]}


def write_mesh(settings: bpy.types.PropertyGroup, smoke: Smoke, path: Path) -> str:
    """Write the triangles of the mesh that masks, as it is in this frame; empty where none does.

    Args:
        settings: Of the scene.
        smoke: What is painted: corners are in the world of its files.
        path: Where to, as an array `[n, 3, 3]`.

    Raises:
        ProblemError: If the object has no faces.
    """
    if settings.mask != "MESH" or not is_wanted(settings):
        return ""
    shape = settings.mask_object
    seen = shape.evaluated_get(bpy.context.evaluated_depsgraph_get())
    try:
        mesh = seen.to_mesh()
    except RuntimeError:  # as of an empty
        mesh = None
    if mesh is None or not mesh.polygons:
        raise ProblemError(f"{shape.name}: has no faces to be inside of; mask by another object")
    mesh.calc_loop_triangles()
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    seen.to_mesh_clear()
    matrix = np.array(_world_of(settings, smoke).inverted_safe() @ seen.matrix_world)
    world = places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    np.save(path, world[corners].reshape(-1, 3, 3))
    return str(path)


def placed(placement: Placement | None) -> Matrix:
    """From the world of the files to the space of the object that has them."""
    if placement is None:
        return Matrix.Identity(4)
    return Matrix.Translation(placement.shift) @ Matrix.Diagonal((*placement.scale, 1))


def _world_of(settings: bpy.types.PropertyGroup, smoke: Smoke) -> Matrix:
    """From the world of the files to that of the scene."""
    return settings.source.matrix_world @ placed(smoke.placement)
