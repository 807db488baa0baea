# SPDX-License-Identifier: GPL-3.0-or-later
"""Train, and see whether one can: what the buttons do that need a Python of the user's own."""

import dataclasses
from pathlib import Path

import bpy

from . import request
from .job import Job
from .problem import ProblemError
from .scene import source
from .versions import TRAINING, style_folder_of
from .work import Working, begin_training, new_folder


class VNCA_OT_train(Working):
    """Learn a style from the picture, on the current frame"""

    bl_idname = "vnca.train"
    bl_label = "Train"
    kept = "Go On goes on with the training"
    goes_on: bpy.props.BoolProperty(
        name="Go On", description="Go on with a training that was cancelled", options={"SKIP_SAVE"}
    )

    def start(self, context: bpy.types.Context) -> Job:
        """Train in a folder beside the paintings."""
        return begin_training(context, train_job(context.scene, goes_on=self.goes_on))

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """Paint with it from now on."""
        settings = scene.vnca
        settings.way, settings.model = "MODEL", job.result["model"]
        return f"Style learned: {settings.model}"


class VNCA_OT_check_training(Working):
    """See whether the Python for training has what it takes"""

    bl_idname = "vnca.check_training"
    bl_label = "Check"
    bl_options = {"REGISTER"}
    kept = "nothing was changed"

    def start(self, context: bpy.types.Context) -> Job:
        """Ask it."""
        return begin_training(context, request.job("check", []))

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """What it said."""
        told = job.result
        return f"Training works: vnca {told['version']} in Python {told['python']}"


def train_job(scene: bpy.types.Scene, *, goes_on: bool = False) -> dict[str, object]:
    """What the worker is told of a training on the current frame.

    Args:
        scene: Whose settings say what is learned.
        goes_on: Whether an interrupted training is gone on with, on what it began with.

    Raises:
        ProblemError: If something is missing for it.
    """
    settings = scene.vnca
    picture = source.absolute(settings.picture, "the picture")
    if not picture:
        raise ProblemError("Choose a picture to learn from")
    if not Path(picture).is_file():
        raise ProblemError(f"{picture}: there is no such picture")
    out = TRAINING.next_version(style_folder_of(scene, picture), goes_on=goes_on)
    facts = {"out": str(out), "picture": str(new_folder() / "picture.png")}
    if goes_on:
        return request.job("train", request.resume_words(str(out)), **facts, staged=[])
    preset = settings.preset
    if preset == "OWN":
        preset = source.absolute(settings.preset_file, "the preset")
        if not Path(preset).is_file():
            raise ProblemError(f"{preset or 'Own'}: there is no such preset; choose one")
    smoke = source.smoke_of(scene, out, masked=False)
    number = scene.frame_current + source.shift_of(settings.source)
    number = min(smoke.numbers, key=lambda one: abs(one - number))
    smoke = smoke.only((number,))
    staged = [dataclasses.asdict(one) for one in smoke.staged]
    words = request.train_words(smoke, smoke.file(number), picture, str(out), preset, settings.seed)
    return request.job("train", words, **facts, staged=staged)


_CLASSES = (VNCA_OT_train, VNCA_OT_check_training)

register, unregister = bpy.utils.register_classes_factory(_CLASSES)
