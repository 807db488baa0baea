# SPDX-License-Identifier: GPL-3.0-or-later
"""Paints a baked plume and renders it: `python paint.py FOLDER ZIP [STYLE]`; needs bpy."""

import os
import shutil
import sys
import tempfile
from math import radians
from pathlib import Path

_PROFILE = tempfile.mkdtemp(prefix="vnca-profile-")
os.environ["BLENDER_USER_RESOURCES"] = _PROFILE  # before bpy is imported

import bpy

RENDERED = (16, 26, 36)
SIZE = 350, 500
_LAMPS = (("Key", 14.0, (55, 0, -50)), ("Fill", 4.5, (70, 0, 35)), ("Rim", 4.0, (60, 0, 140)))
"""Suns: what they are called, how strong they are, and how they are turned, degrees."""


def add_studio(scene: bpy.types.Scene) -> None:
    """A camera, lamps, and a dark world."""
    camera = bpy.data.objects.new("View", bpy.data.cameras.new("View"))
    camera.location, camera.rotation_euler = (0, -6.6, 1.35), (radians(90), 0, 0)
    camera.data.lens = 80
    scene.collection.objects.link(camera)
    scene.camera = camera
    for lamp in [one for one in scene.objects if one.type == "LIGHT"]:
        bpy.data.objects.remove(lamp)
    for name, energy, turn in _LAMPS:
        sun = bpy.data.lights.new(name, "SUN")
        sun.energy, sun.angle = energy, 0.2
        lamp = bpy.data.objects.new(name, sun)
        lamp.rotation_euler = [radians(angle) for angle in turn]
        scene.collection.objects.link(lamp)
    world = scene.world or bpy.data.worlds.new("World")
    scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.004, 0.0045, 0.006, 1)
    background.inputs["Strength"].default_value = 1.0


def main(folder: Path, package: str, style: str) -> None:
    """Install, open, choose, preview, paint, render."""
    done = bpy.ops.extensions.package_install_files(
        filepath=package, repo="user_default", enable_on_install=True
    )
    assert done == {"FINISHED"}
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scene.blend"))
    scene = bpy.context.scene
    domain = scene.objects["Plume"]
    for other in scene.objects:
        for modifier in other.modifiers:  # baked; the solver of bpy is broken
            modifier.show_viewport = modifier.show_render = False
        other.hide_render = other.type == "MESH"
    settings = scene.vnca
    settings.source, settings.style, settings.refine = domain, style, 2
    scene.frame_set(RENDERED[-1])
    bpy.ops.vnca.preview()
    work = sys.modules["bl_ext.user_default.vnca.work"]
    shutil.copy(work.current.picture, folder / "preview.png")
    bpy.ops.vnca.paint()
    add_studio(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "painted.blend"))
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.volume_bounces = "CPU", 12, 2
    scene.cycles.use_denoising = True
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format = "PNG"
    scene.view_settings.view_transform = "Standard"
    for frame in reversed(RENDERED):
        scene.frame_set(frame)
        scene.render.filepath = str(folder / f"lit_{frame:04d}.png")
        bpy.ops.render.render(write_still=True)


try:
    main(
        Path(sys.argv[1]).absolute(),
        str(Path(sys.argv[2]).absolute()),
        (sys.argv[3:] or ["cafe"])[0],
    )
finally:
    shutil.rmtree(_PROFILE, ignore_errors=True)
