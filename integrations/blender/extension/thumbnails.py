# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in the interface: those of the styles, and of the work."""

from pathlib import Path

import bpy.utils.previews

from . import styles

_pictures: bpy.utils.previews.ImagePreviewCollection | None = None
_items: list[tuple[str, str, str, int, int]] = []
_work: tuple[str, int] = ("", 0)


def style_items(_: object, __: object) -> list[tuple[str, str, str, int, int]]:
    """The styles of the library, as an enumeration with pictures.

    Blender keeps no reference to what it is given, so the list stays here.
    """
    return _items


def icon_of_work(path: str | None) -> int:
    """Number of the latest picture of the work; 0 if there is none.

    Loaded again when the file has changed.
    """
    global _work
    if path is None or _pictures is None or not Path(path).is_file():
        return 0
    name = f"{path}:{Path(path).stat().st_mtime_ns}"
    if name != _work[0]:
        if _work[0] in _pictures:
            del _pictures[_work[0]]
        _work = name, _pictures.load(name, path, "IMAGE").icon_id
    return _work[1]


def register() -> None:
    """Load the pictures of the library."""
    global _pictures, _work
    _pictures, _work = bpy.utils.previews.new(), ("", 0)
    _items.clear()
    for number, style in enumerate(styles.library()):
        icon = 0
        if style.thumbnail.is_file():
            icon = _pictures.load(style.name, str(style.thumbnail), "IMAGE").icon_id
        _items.append((style.name, style.label, style.title, icon, number))
    if not _items:
        _items.append(("NONE", "No styles", "vnca is missing in the extension", 0, 0))


def unregister() -> None:
    """Let go of the pictures."""
    global _pictures
    if _pictures is not None:
        bpy.utils.previews.remove(_pictures)
    _pictures = None
    _items.clear()
