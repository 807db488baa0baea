# SPDX-License-Identifier: GPL-3.0-or-later
"""Paints smoke in the style of a picture, in Blender: the extension's parts, as Blender loads them.

The work is done by vnca in a process of its own (`worker/`); `job` follows it. What knows nothing
of Blender (`cache`, `interpreter`, `job`, `request`, `styles`) imports no `bpy`.
"""

_PARTS = ("thumbnails", "settings", "work", "operators", "training", "scene.mixing", "panel")


def register() -> None:
    """Add properties, operators and panels."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Remove them, and end what is at work."""
    for part in reversed(_parts()):
        part.unregister()


def _parts() -> list:
    from importlib import import_module

    return [import_module(f".{name}", __name__) for name in _PARTS]
