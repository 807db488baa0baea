# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume that shows what was painted: where the smoke was, when it was, as vnca saw it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

from ..request import Smoke, velocity_scale
from . import material, mixing
from .mask import placed
from .source import shift_of


def show(scene: bpy.types.Scene, smoke: Smoke, told: Mapping[str, Any]) -> bpy.types.Object:
    """The volume of a painting, made or painted anew.

    Args:
        scene: The scene, whose settings say what was painted.
        smoke: What that was.
        told: What the worker told at the end.
    """
    settings = scene.vnca
    source, painted = settings.source, settings.result
    if painted is None or painted.type != "VOLUME" or painted.name not in scene.objects:
        data = bpy.data.volumes.new(f"{smoke.name} painted")
        painted = bpy.data.objects.new(data.name, data)
        _collection(scene, source).objects.link(painted)
        settings.result = painted
    data = painted.data
    _set_files(data, smoke, told, source)
    _set_place(painted, source, smoke)
    _set_material(painted, float(told["extinction"]), keeps=bool(told["keeps"]))
    mixing.adjust(painted, settings)
    if settings.hide_source and source.library is None:
        source.hide_render = True
        source.hide_set(True)
    return painted


def _collection(scene: bpy.types.Scene, source: bpy.types.Object) -> bpy.types.Collection:
    """Where the smoke is, so that it is seen in the same layers; the scene's if that is linked."""
    ours = {scene.collection, *scene.collection.children_recursive}
    mine = (one for one in source.users_collection if one in ours and one.library is None)
    return next(mine, scene.collection)


def _set_files(
    data: bpy.types.Volume, smoke: Smoke, told: Mapping[str, Any], source: bpy.types.Object
) -> None:
    files = told["files"]
    is_near = bpy.data.filepath and Path(files[0]).drive == Path(bpy.data.filepath).drive
    data.grids.unload()
    data.filepath = bpy.path.relpath(files[0]) if is_near else files[0]
    data.is_sequence = False
    if "velocity" in told:
        data.grids.load()  # Blender takes the name of the velocity only from what is loaded.
        data.velocity_grid = told["velocity"]
        unit, scale = velocity_scale(smoke, told["units"], told["voxel"])
        data.velocity_unit, data.velocity_scale = unit, scale
        data.grids.unload()
    if smoke.is_sequence:
        numbers = [_number(file) for file in files]
        first, last = min(numbers), max(numbers)
        data.is_sequence = True
        data.frame_start = first - shift_of(source)
        data.frame_offset = first - 1
        data.frame_duration = last - first + 1
        if source.type == "VOLUME":
            data.sequence_mode = source.data.sequence_mode
    data.update_tag()


def _number(path: str) -> int:
    digits = ""
    for character in reversed(Path(path).stem):
        if character.isdigit():
            digits = character + digits
        elif digits:
            break
    return int(digits)


def _set_place(painted: bpy.types.Object, source: bpy.types.Object, smoke: Smoke) -> None:
    """On the cells of the smoke, and wherever its object goes from now on."""
    painted.parent = source
    painted.matrix_parent_inverse = Matrix.Identity(4)
    painted.matrix_basis = placed(smoke.placement)


def _set_material(painted: bpy.types.Object, extinction: float, *, keeps: bool) -> None:
    """As opaque as vnca shows it; a material of the artist's own stays.

    Blender counts the density of a volume in lengths of the object, and emission too, so neither
    depends on how large the object is.
    """
    if painted.active_material is None:
        painted.data.materials.append(material.make(painted.name))
    material.set_files(painted.active_material, extinction, keeps=keeps)
