# SPDX-License-Identifier: GPL-3.0-or-later
"""Where paintings and styles lie: a folder for each, and in it one for each version.

Whatever is made has files of its own: Blender keeps what it has read of a file, what is seen in the
scene stays until another painting is finished, and a style that was painted with is not replaced.
"""

from dataclasses import dataclass
from pathlib import Path

import bpy

from .problem import ProblemError
from .scene import source

_VERSION = "v[0-9][0-9][0-9]"
_MODEL = "model.safetensors"
_STYLE = "style "
"""What the names of folders of styles begin with."""


@dataclass(frozen=True)
class Made:
    """What there are versions of.

    Attributes:
        what: Its name.
        verb: What makes one.
        finished: Files of which there is one in a version that is worth keeping.
        unfinished: Files that are there while there is something left to do.
    """

    what: str
    verb: str
    finished: str
    unfinished: str

    def next_version(self, folder: Path, *, goes_on: bool) -> Path:
        """The folder of the next version, or of the last if that is not finished.

        Raises:
            ProblemError: If there is nothing to go on with.
        """
        last = _last(folder)
        if goes_on and (last is None or not self._is_unfinished(last)):
            raise ProblemError(f"{folder}: there is no {self.what} to go on with; {self.verb}")
        if last is None:
            return folder / "v001"
        if self._is_unfinished(last) or not any(last.glob(self.finished)):
            return last
        return folder / f"v{int(last.name[1:]) + 1:03d}"

    def can_go_on(self, folder: Path) -> bool:
        """Whether the last version was cancelled."""
        try:
            last = _last(folder)
            return last is not None and self._is_unfinished(last)
        except OSError:
            return False

    def _is_unfinished(self, version: Path) -> bool:
        return any(version.glob(self.unfinished))


PAINTING = Made("painting", "paint", "painted/*.vdb", "painted/.*.resume.safetensors")
TRAINING = Made("training", "train", _MODEL, "checkpoint.safetensors")


def folder_of(scene: bpy.types.Scene) -> Path:
    """The folder of a painting: one for each smoke and style.

    Raises:
        ProblemError: If no smoke is chosen, or it is relative to a scene that is not saved.
    """
    settings = scene.vnca
    if settings.source is None:
        raise ProblemError(source.NOTHING_CHOSEN)
    name = settings.style if settings.way == "LIBRARY" else _name_of(Path(settings.model))
    return output_of(scene) / _clean(f"{settings.source.name} {name}")


def style_folder_of(scene: bpy.types.Scene, picture: str) -> Path:
    """The folder of the styles that are learned from a picture.

    Raises:
        ProblemError: If it is relative to a scene that is not saved.
    """
    return output_of(scene) / _clean(_STYLE + Path(picture).stem)


def output_of(scene: bpy.types.Scene) -> Path:
    """The folder of all paintings.

    Raises:
        ProblemError: If there is none, or it is relative to a scene that is not saved.
    """
    path = source.absolute(scene.vnca.folder, "the output folder")
    if not path:
        raise ProblemError("Choose a folder for the output")
    return Path(path)


def can_go_on_painting(scene: bpy.types.Scene) -> bool:
    """Whether there is a painting that was cancelled."""
    try:
        return PAINTING.can_go_on(folder_of(scene))
    except ProblemError:
        return False


def can_go_on_training(scene: bpy.types.Scene) -> bool:
    """Whether there is a training on the chosen picture that was cancelled."""
    try:
        return TRAINING.can_go_on(style_folder_of(scene, scene.vnca.picture))
    except ProblemError:
        return False


def _last(folder: Path) -> Path | None:
    versions = sorted(folder.glob(_VERSION))
    return versions[-1] if versions else None


def _name_of(model: Path) -> str:
    """A style that was learned here goes by its picture, another by its file or folder."""
    if model.name == _MODEL:
        model = model.parent
    if model.match(_VERSION) and model.parent.name.startswith(_STYLE):
        return model.parent.name.removeprefix(_STYLE)
    return model.stem if model.suffix == ".safetensors" else model.name


def _clean(name: str) -> str:
    return "".join("_" if letter in '<>:"/\\|?*#%$' else letter for letter in name).strip(" .")
