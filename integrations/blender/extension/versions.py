# SPDX-License-Identifier: GPL-3.0-or-later
"""Where paintings lie: a folder for each smoke and style, and in it one for each version."""

from pathlib import Path

import bpy

from . import source
from .problem import ProblemError

_VERSION = "v[0-9][0-9][0-9]"


def folder_of(scene: bpy.types.Scene) -> Path:
    """The folder of a painting: one for each smoke and style.

    Raises:
        ProblemError: If no smoke is chosen, or it is relative to a scene that is not saved.
    """
    settings = scene.vnca
    if settings.source is None:
        raise ProblemError(source.NOTHING_CHOSEN)
    name = settings.style if settings.way == "LIBRARY" else Path(settings.model).name
    smoke = settings.source.name
    clean = "".join("_" if letter in '<>:"/\\|?*#%$' else letter for letter in f"{smoke} {name}")
    return output_of(scene) / clean.strip(" .")


def version_to_paint(folder: Path, *, goes_on: bool) -> Path:
    """The folder of the next version of a painting, or of the last if that is not finished.

    Every painting has files of its own: Blender keeps what it has read of a file, and what is seen
    in the scene stays until another painting is finished.

    Raises:
        ProblemError: If there is nothing to go on with.
    """
    versions = sorted(folder.glob(_VERSION))
    last = versions[-1] if versions else None
    if goes_on and (last is None or not _is_unfinished(last)):
        raise ProblemError(f"{folder}: there is no painting to go on with; paint")
    if last is not None and (_is_unfinished(last) or not any((last / "painted").glob("*.vdb"))):
        return last
    number = int(last.name[1:]) + 1 if last is not None else 1
    return folder / f"v{number:03d}"


def can_go_on(scene: bpy.types.Scene) -> bool:
    """Whether there is a painting that was cancelled."""
    try:
        return any(_is_unfinished(path) for path in sorted(folder_of(scene).glob(_VERSION))[-1:])
    except (ProblemError, OSError):
        return False


def _is_unfinished(version: Path) -> bool:
    return any((version / "painted").glob(".*.resume.safetensors"))


def output_of(scene: bpy.types.Scene) -> Path:
    """The folder of all paintings.

    Raises:
        ProblemError: If there is none, or it is relative to a scene that is not saved.
    """
    path = source.absolute(scene.vnca.folder, "the output folder")
    if not path:
        raise ProblemError("Choose a folder for the output")
    return Path(path)
