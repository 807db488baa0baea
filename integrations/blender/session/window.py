# SPDX-License-Identifier: GPL-3.0-or-later
"""Uses the panel in a window: `blender SCENE --python window.py -- FOLDER [EXTENSION PICTURE]`.

For a Blender with a window of X11, which may be a virtual one (`xvfb-run`), and `import` of
ImageMagick. The extension is installed; or EXTENSION is the
folder of its sources, registered by hand where Blender knows no extensions yet. With PICTURE a
style is trained, too.

FOLDER gets screenshots, and `window.json`: seconds from pressing Esc until the window is free again
and until the worker's process is gone, and for how long the window was busy at most meanwhile.
"""

import ctypes
import importlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy

FOLDER, *REST = sys.argv[sys.argv.index("--") + 1 :]
INSTALLED = "bl_ext.user_default.vnca"
MOMENTS = (("", 0.0), ("", 1.0), ("{}ing", 0.0), ("{}ing", 3.0))
"""Seconds after work is what it says, or after its start, at which Esc is pressed."""
TICK = 0.02
FRAME = 30
PICTURES = 4
"""Of a training, until there is something to be seen."""
ESCAPE = 0xFF1B
"""X11's number of the key."""

told: dict[str, Any] = {"blender": bpy.app.version_string, "cancelled": []}
_busy = [0.0, 0.0]  # when the window last was free, and the longest time that it was not


def extension(part: str) -> Any:
    """A part of the extension, installed or not."""
    home = INSTALLED if INSTALLED in bpy.context.preferences.addons else "extension"
    return importlib.import_module(f"{home}.{part}")


def steps() -> Iterator[float]:
    """What the artist does; yields how long to wait."""
    scene = bpy.context.scene
    settings, work = scene.vnca, extension("work")
    settings.source, settings.style, settings.refine = scene.objects["Plume"], "stained_glass", 2
    settings.folder = "//window"
    scene.frame_set(FRAME)
    show_panel()
    yield 1.0
    press("preview")
    yield from finished(work)
    yield from screenshot("panel.png")
    if len(REST) > 1:
        settings.way, settings.picture = "PICTURE", REST[1]
        yield from screenshot("picture.png")
        press("train")
        while work.current.is_running and work.current.pictures < PICTURES:
            yield 0.1
        yield from screenshot("training.png")
        yield from esc("train", work)
        for what, seconds in MOMENTS:
            yield from cancelled("train", what, seconds, work)
    settings.way, settings.refine = "LIBRARY", 8
    for what, seconds in MOMENTS:
        yield from cancelled("paint", what, seconds, work)
    yield from screenshot("cancelled.png")
    (Path(FOLDER) / "window.json").write_text(json.dumps(told, indent=2) + "\n")
    bpy.ops.wm.quit_blender()


def show_panel() -> None:
    """Open our tab in the sidebar of the 3D view, and give it the whole window."""
    window = bpy.context.window_manager.windows[0]
    area = next(one for one in window.screen.areas if one.type == "VIEW_3D")
    area.spaces.active.show_region_ui = True
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.screen.screen_full_area()


def press(name: str, **options: object) -> None:
    """Press a button of the panel."""
    window = bpy.context.window_manager.windows[0]
    area = next(one for one in window.screen.areas if one.type == "VIEW_3D")
    region = next(one for one in area.regions if one.type == "UI")
    if hasattr(region, "active_panel_category"):
        with suppress(AttributeError):  # before 4.2 it can only be read
            region.active_panel_category = "vnca"
    with bpy.context.temp_override(window=window, area=area, region=region):
        getattr(bpy.ops.vnca, name)("INVOKE_DEFAULT", **options)


def finished(work: Any) -> Iterator[float]:
    """Wait for the work."""
    while work.current.is_running:
        yield TICK


def cancelled(name: str, what: str, seconds: float, work: Any) -> Iterator[float]:
    """Begin, and press Esc some time after."""
    press(name)
    job, wanted = work.current, what.format(name)
    while job.is_running and wanted not in ("", job.what):
        yield TICK
    begun = time.monotonic()
    while time.monotonic() - begun < seconds and job.is_running:
        yield TICK
    yield from esc(name, work)


def esc(name: str, work: Any) -> Iterator[float]:
    """Press Esc, and wait for the end."""
    job, _busy[1] = work.current, 0.0
    what = f"{job.what} {job.done}/{job.total}"
    start = time.monotonic()
    press_escape()
    while job.is_running and time.monotonic() - start < 30:
        yield TICK
    free = time.monotonic()
    while job.poll() and time.monotonic() - start < 30:
        yield TICK
    told["cancelled"].append(
        {
            "work": name,
            "at": what,
            "state": job.state,
            "seconds": round(free - start, 2),
            "seconds_until_gone": round(time.monotonic() - start, 2),
            "longest_busy": round(_busy[1], 2),
        }
    )


def press_escape() -> None:
    """Press Esc over the window, as a keyboard does."""
    _x11.XOpenDisplay.restype = ctypes.c_void_p
    display = ctypes.c_void_p(_x11.XOpenDisplay(None))
    _xtest.XTestFakeMotionEvent(display, -1, 400, 400, ctypes.c_ulong(0))
    key = _x11.XKeysymToKeycode(display, ctypes.c_ulong(ESCAPE)) & 0xFF
    for is_down in (True, False):
        _xtest.XTestFakeKeyEvent(display, key, is_down, ctypes.c_ulong(0))
    _x11.XCloseDisplay(display)  # sends them


def screenshot(name: str) -> Iterator[float]:
    """Save what is seen: by ImageMagick, since not all drivers let Blender read its window."""
    window = bpy.context.window_manager.windows[0]
    for area in window.screen.areas:
        area.tag_redraw()
    yield 3.0
    subprocess.run(["import", "-window", "root", str(Path(FOLDER) / name)], check=True)


def tick() -> "float | None":
    """Go on with the steps."""
    now = time.monotonic()
    if _busy[0]:
        _busy[1] = max(_busy[1], now - _busy[0])
    wait = next(_steps, None)
    _busy[0] = time.monotonic() + (wait or 0)
    return wait


_x11, _xtest = (ctypes.CDLL(f"lib{name}.so.6") for name in ("X11", "Xtst"))
_steps = steps()
Path(FOLDER).mkdir(parents=True, exist_ok=True)
bpy.context.preferences.view.show_splash = False
if INSTALLED not in bpy.context.preferences.addons and REST:
    sys.path.insert(0, str(Path(REST[0]).absolute().parent))
    importlib.import_module("extension").register()
bpy.app.timers.register(tick, first_interval=2.0)
