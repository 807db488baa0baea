# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of painted smoke in Cycles, lit by a sun; for `lit.py`, which calls it.

    PYTHON_WITH_BPY benchmarks/styles/in_cycles.py REQUEST.json

The material is the one that the extension for Blender gives to what it paints. The request has

    volume       the VDB file
    views        of each the world's axes in the picture (right, up, forward), the point in its
                 middle, its height in the world, the extinction of density 1, whether it is grey
                 (those last), and its file: npy, linear RGBA with premultiplied colours
    size         rows and columns
    samples      of a pixel
    towards_sun  degrees to the right of the camera and above its horizon
    ambient      share of the light that comes from everywhere
"""

import importlib
import json
import sys
import types
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

EXTENSION = Path(__file__).parents[2] / "integrations" / "blender" / "extension"
BOUNCES = 12
"""As many as the extension's test of light has."""
GREY = 0.214
"""Linear, of sRGB ½."""
AWAY = 4.0
"""From the camera to the middle of the picture, in heights of it."""


def main(request: Path) -> None:
    """Render all views."""
    asked = json.loads(request.read_text())
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    material = smoke(scene, asked["volume"])
    set_up(scene, asked)
    sun = add_light(scene, asked["ambient"])
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type = "ORTHO"
    scene.collection.objects.link(camera)
    scene.camera = camera
    for view in asked["views"]:
        right, up, forward = (Vector(axis) for axis in view["axes"])
        turn = Matrix((right, up, -forward)).transposed()
        camera.data.ortho_scale = view["height"]
        camera.data.clip_end = 2 * AWAY * view["height"]
        middle = Vector(view["middle"]) - AWAY * view["height"] * forward
        camera.matrix_world = Matrix.Translation(middle) @ turn.to_4x4()
        aside, above = np.radians(asked["towards_sun"])
        level = -(forward - Vector((0, 0, forward.z))).normalized()
        level = float(np.cos(aside)) * level + float(np.sin(aside)) * right
        towards = float(np.cos(above)) * level + float(np.sin(above)) * Vector((0, 0, 1))
        sun.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
        material.set_files(bpy.data.materials["Smoke"], view["extinction"], keeps=False)
        if view["grey"]:
            make_grey(bpy.data.materials["Smoke"].node_tree)
        scene.render.filepath = view["out"] + ".exr"
        bpy.ops.render.render(write_still=True)
        np.save(view["out"], pixels_of(scene.render.filepath))


def smoke(scene: bpy.types.Scene, path: str) -> types.ModuleType:
    """Add the volume with its material, and return the module that made that."""
    # The extension's parts that are needed, without what registers it.
    for name, folder in (("extension", EXTENSION), ("extension.scene", EXTENSION / "scene")):
        package = types.ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
    material = importlib.import_module("extension.scene.material")
    volume = bpy.data.volumes.new("Smoke")
    volume.filepath = path
    volume.materials.append(material.make("Smoke"))
    scene.collection.objects.link(bpy.data.objects.new("Smoke", volume))
    return material


def set_up(scene: bpy.types.Scene, asked: dict) -> None:
    """Cycles on the processor, before nothing, and linear numbers in its files."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CPU", asked["samples"], 1
    scene.cycles.use_denoising = False
    scene.cycles.volume_bounces = BOUNCES
    scene.render.resolution_x = scene.render.resolution_y = asked["size"]
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"


def make_grey(tree: bpy.types.NodeTree) -> None:
    """Let smoke scatter as a painting of mid-grey."""
    colour = next(n for n in tree.nodes if n.type == "PRINCIPLED_VOLUME").inputs["Color"]
    for link in colour.links:
        tree.links.remove(link)
    colour.default_value = (GREY, GREY, GREY, 1)


def pixels_of(path: str) -> np.ndarray:
    """Numbers of a picture `[r, c, 4]`."""
    image = bpy.data.images.load(path, check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    columns, rows = image.size
    pixels = np.array(image.pixels[:], np.float32).reshape(rows, columns, 4)[::-1]
    bpy.data.images.remove(image)
    return pixels


def add_light(scene: bpy.types.Scene, ambient: float) -> bpy.types.Object:
    """A sun, and light from everywhere.

    A volume scatters as much of a sun of strength 4π as of radiance 1 from everywhere.
    """
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 4 * np.pi * (1 - ambient), 0.05
    lamp = bpy.data.objects.new("Sun", sun)
    scene.collection.objects.link(lamp)
    world = bpy.data.worlds.new("World")
    if world.node_tree is None:  # before Blender 5
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    background.inputs["Strength"].default_value = ambient
    scene.world = world
    return lamp


if __name__ == "__main__":
    main(Path(sys.argv[1]))
