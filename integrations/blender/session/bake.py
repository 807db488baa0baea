# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes a plume in a small domain: `blender --background --python bake.py -- FOLDER`."""

import sys
from pathlib import Path

import bpy

FRAMES = 36
RESOLUTION = 56


def main(folder: Path) -> None:
    """Make the scene, bake it, and save it as scene.blend."""
    folder.mkdir(parents=True, exist_ok=True)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.22, location=(0, 0, 0.35))
    bpy.ops.object.quick_smoke()
    domain = bpy.context.object
    domain.name, domain.location, domain.dimensions = "Plume", (0, 0, 1.5), (2, 2, 3)
    bpy.context.view_layer.update()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    settings = domain.modifiers["Fluid"].domain_settings
    settings.cache_type, settings.cache_data_format = "ALL", "OPENVDB"
    settings.resolution_max, settings.cache_frame_end = RESOLUTION, FRAMES
    settings.cache_directory = "//cache"
    settings.vorticity = 0.3
    bpy.context.scene.frame_end = FRAMES
    bpy.ops.fluid.bake_all()
    bpy.ops.wm.save_mainfile()


main(Path(sys.argv[-1]).absolute())
