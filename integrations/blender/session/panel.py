# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes a screenshot of the panel: `blender --python panel.py -- SCENE PICTURE EXTENSION`.

For a Blender with a window, which may be a virtual one (`xvfb-run`). EXTENSION is the folder of the
extension's sources; vnca has to be found by this Blender's Python (PYTHONPATH). The extension is
registered by hand, so that it is drawn in Blenders that know no extensions yet.
"""

import importlib
import sys
from pathlib import Path

import bpy

SCENE, PICTURE, SOURCES = sys.argv[-3:]


def only_ours() -> None:
    """Leave the window to our panel, in the physics of the domain."""
    for kind in bpy.types.Panel.__subclasses__():
        of_physics = getattr(kind, "bl_context", "") == "physics"
        if of_physics and not kind.__name__.startswith("VNCA") and kind.is_registered:
            bpy.utils.unregister_class(kind)
    panel = importlib.import_module("extension.panel").VNCA_PT_domain
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()
    bpy.utils.register_class(panel)


def take() -> None:
    """Fill the window with the panel, preview a frame, and save what is seen."""
    window = bpy.context.window_manager.windows[0]
    only_ours()
    area = next(one for one in window.screen.areas if one.type == "PROPERTIES")
    area.spaces.active.context = "PHYSICS"
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.vnca.preview("INVOKE_DEFAULT")
        bpy.ops.screen.screen_full_area()
    bpy.app.timers.register(save_when_done, first_interval=1.0)


def save_when_done() -> "float | None":
    """Save the screenshot once the preview is there."""
    work = importlib.import_module("extension.work")
    if work.current is not None and work.current.is_running:
        return 0.5
    window = bpy.context.window_manager.windows[0]
    for area in window.screen.areas:
        area.tag_redraw()
    bpy.app.timers.register(save, first_interval=2.0)
    return None


def save() -> None:
    """Save what the window shows, and end."""
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        bpy.ops.screen.screenshot(filepath=PICTURE)
    bpy.ops.wm.quit_blender()


sys.path.insert(0, str(Path(SOURCES).absolute().parent))
bpy.ops.wm.open_mainfile(filepath=SCENE)
importlib.import_module("extension").register()
chosen = bpy.context.scene.vnca
chosen.source, chosen.style = bpy.context.scene.objects["Plume"], "cafe"
bpy.context.scene.frame_set(30)
bpy.app.timers.register(take, first_interval=2.0)
