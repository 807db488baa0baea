# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of imported smoke: `blender --background --python volume.py -- FOLDER SMOKE`.

For a Blender that has no fluid solver, in the place of `bake.py`: the OpenVDB files of the folder
SMOKE, of a fluid domain, become a volume called Plume, and FOLDER gets scene.blend.
"""

import re
import sys
from pathlib import Path

import bpy

TIME_SCALE = 0.4
"""Of the smoke that the project shares; only how far it is seen to move depends on it."""


def main(folder: Path, smoke: Path) -> None:
    """Make the scene and save it."""
    folder.mkdir(parents=True, exist_ok=True)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    frames = sorted(smoke.glob("*.vdb"))
    first, last = (int(re.findall(r"\d+", path.stem)[-1]) for path in (frames[0], frames[-1]))
    volume = bpy.data.volumes.new("Plume")
    volume.filepath, volume.is_sequence = str(frames[0]), True
    volume.frame_start, volume.frame_offset = first, first - 1
    volume.frame_duration = last - first + 1
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("Plume", volume))
    scene.frame_start, scene.frame_end = first, last
    if hasattr(scene, "vnca"):  # the extension is installed
        scene.vnca.units, scene.vnca.time_scale = "mantaflow", TIME_SCALE
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))


main(*(Path(word).absolute() for word in sys.argv[-2:]))
