# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview, paint, cancel: what the buttons do that need nothing but the extension."""

import dataclasses
from pathlib import Path

import bpy

from . import request, work
from .job import Job
from .problem import ProblemError
from .scene import mask, result, source
from .settings import is_smoke
from .versions import PAINTING, folder_of


class VNCA_OT_paint(work.Working):
    """Paint the frames, and show them"""

    bl_idname = "vnca.paint"
    bl_label = "Paint"
    goes_on: bpy.props.BoolProperty(
        name="Go On", description="Go on with a painting that was cancelled", options={"SKIP_SAVE"}
    )

    def start(self, context: bpy.types.Context) -> Job:
        """Paint into the folder of the smoke and its style."""
        scene = context.scene
        look = source.look_of(scene.vnca)
        out = PAINTING.next_version(folder_of(scene), goes_on=self.goes_on)
        smoke = source.smoke_of(scene, out)
        frames = source.frames_of(scene, smoke, source.shift_of(scene.vnca.source))
        self.smoke = smoke.only(frames)
        asked = paint_job(scene, "paint", self.smoke, look, out, goes_on=self.goes_on)
        return work.begin_painting(asked)

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """Show the painting."""
        painted = result.show(scene, self.smoke, job.result)
        return f"{len(job.result['files'])} frames painted: {painted.name}"


class VNCA_OT_preview(work.Working):
    """Paint the current frame only, as a picture in the panel"""

    bl_idname = "vnca.preview"
    bl_label = "Preview This Frame"
    bl_options = {"REGISTER"}
    kept = "nothing was changed"

    def start(self, context: bpy.types.Context) -> Job:
        """Paint the frame into a folder that is forgotten."""
        scene = context.scene
        look, out = source.look_of(scene.vnca), work.new_folder()
        smoke = source.smoke_of(scene, out)
        number = scene.frame_current + source.shift_of(scene.vnca.source)
        if smoke.is_sequence and number not in smoke.numbers:
            raise ProblemError(
                f"{smoke.name}: no file for the frame {scene.frame_current}; there are "
                f"{smoke.numbers[0]} to {smoke.numbers[-1]}"
            )
        one = smoke.only((number,) if smoke.is_sequence else smoke.numbers)
        return work.begin_painting(paint_job(scene, "preview", one, look, out))

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """The panel shows it."""
        return "Preview painted"


class VNCA_OT_cancel(bpy.types.Operator):
    """End the work; what is finished is kept"""

    bl_idname = "vnca.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        """Whether something is at work."""
        return work.current is not None and work.current.is_running

    def execute(self, _: bpy.types.Context) -> set[str]:
        """Ask the worker to end."""
        if work.current is not None:
            work.current.cancel()
        return {"FINISHED"}


class VNCA_OT_log(bpy.types.Operator):
    """Show all that the last worker said, as a text"""

    bl_idname = "vnca.log"
    bl_label = "Show Log"

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        """Whether there was one."""
        return work.current is not None

    def execute(self, _: bpy.types.Context) -> set[str]:
        """Make the text."""
        assert work.current is not None
        text = bpy.data.texts.get("vnca log") or bpy.data.texts.new("vnca log")
        text.clear()
        text.write("\n".join(work.current.last_lines()))
        self.report({"INFO"}, "In the text editor: vnca log")
        return {"FINISHED"}


class VNCA_OT_use_active(bpy.types.Operator):
    """Paint the smoke of the active object"""

    bl_idname = "vnca.use_active"
    bl_label = "Use Active Object"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it."""
        chosen = context.object
        if chosen is None or not is_smoke(None, chosen):
            self.report({"ERROR"}, "The active object is neither a domain of gas nor a volume")
            return {"CANCELLED"}
        context.scene.vnca.source = chosen
        return {"FINISHED"}


def paint_job(
    scene: bpy.types.Scene,
    kind: request.Kind,
    smoke: request.Smoke,
    look: request.Look,
    out: Path,
    *,
    goes_on: bool = False,
) -> dict[str, object]:
    """What the worker is told of a painting.

    Args:
        scene: Whose settings say what its pictures show.
        kind: Of the frames that are kept, or of one to be looked at.
        smoke: What is painted.
        look: How.
        out: The folder.
        goes_on: Whether an interrupted painting is gone on with.
    """
    frames = request.numbers_text(smoke.numbers)
    settings, aside = scene.vnca, work.new_folder()
    return request.job(
        kind,
        request.paint_words(smoke, look, str(out), frames, goes_on=goes_on),
        out=str(out),
        staged=[dataclasses.asdict(staged) for staged in smoke.staged],
        anew=not goes_on,
        picture=str(aside / "picture.png"),
        shown={"strength": settings.strength, "mask": mask.shape_of(settings, smoke)},
        mesh=mask.write_mesh(settings, smoke, aside / "mask.npy"),
    )


_CLASSES = (
    VNCA_OT_paint,
    VNCA_OT_preview,
    VNCA_OT_cancel,
    VNCA_OT_log,
    VNCA_OT_use_active,
)

register, unregister = bpy.utils.register_classes_factory(_CLASSES)
