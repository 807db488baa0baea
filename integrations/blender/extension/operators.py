# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview, paint, train, cancel: what the buttons do.

The window stays free: work is done by a process of its own, which a timer asks how far it has
come. Without a window (`blender --background`) the operators wait for it instead.
"""

import dataclasses
import sys
import time
from pathlib import Path
from tempfile import mkdtemp

import bpy
from bpy.app.handlers import persistent

from . import interpreter, request, result, source
from .job import Job, clock
from .problem import ProblemError
from .settings import python_for_training
from .versions import can_go_on, folder_of, output_of, version_to_paint

__all__ = ["can_go_on", "current", "folder_of", "version_to_paint"]

WORKER = Path(__file__).parent / "worker"
TICK = 0.1
"""Seconds between two looks at the work."""

current: Job | None = None
"""What is at work, or was last."""
_running: "_Working | None" = None


class _Working(bpy.types.Operator):
    """What has in common whatever is done by a worker."""

    bl_options = {"REGISTER", "UNDO"}
    _timer: bpy.types.Timer | None = None
    _scene = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """One thing at a time."""
        if current is not None and current.is_running:
            cls.poll_message_set("Something is at work already")
            return False
        return True

    def start(self, context: bpy.types.Context) -> Job:
        """Begin the work."""
        raise NotImplementedError

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """Show what came of it; a line that tells of it."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        """With a window: begin, and look at the work now and then."""
        if not self._begin(context):
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, 1)
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look at the work; Esc cancels it."""
        job = current
        if job is None or _running is not self:
            self._tidy(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        is_at_work = job.poll()
        context.window_manager.progress_update(job.fraction)
        _redraw(context)
        if is_at_work:
            return {"PASS_THROUGH"}
        self._tidy(context)
        return self._end()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Without a window, or called by a script: wait for the work."""
        if not self._begin(context):
            return {"CANCELLED"}
        job, told = current, ("", -1)
        assert job is not None
        try:
            while job.poll():
                if told != (job.what, job.done):
                    told = job.what, job.done
                    print(f"vnca: {_progress(job)}", file=sys.stderr, flush=True)
                time.sleep(TICK)
        except KeyboardInterrupt:
            job.end()
            raise
        return self._end()

    def _begin(self, context: bpy.types.Context) -> bool:
        global current, _running
        self._scene = context.scene.name
        try:
            current = self.start(context)
        except (ProblemError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return False
        _running = self
        return True

    def _end(self) -> set[str]:
        job, scene = current, bpy.data.scenes.get(self._scene)
        assert job is not None
        for note in job.notes:
            self.report({"INFO"}, note)
        if job.state == "cancelled":
            self.report({"WARNING"}, "Cancelled; what was painted is kept, and Go On goes on")
            return {"CANCELLED"}
        if job.state == "failed":
            self.report({"ERROR"}, job.message)
            return {"CANCELLED"}
        if scene is None:
            self.report({"WARNING"}, "The scene is gone; the files are there")
            return {"CANCELLED"}
        self.report({"INFO"}, self.finish(scene, job))
        return {"FINISHED"}

    def _tidy(self, context: bpy.types.Context) -> None:
        context.window_manager.progress_end()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None


class VNCA_OT_paint(_Working):
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
        out = version_to_paint(folder_of(scene), goes_on=self.goes_on)
        smoke = source.smoke_of(scene, out)
        frames = source.frames_of(scene, smoke, source.shift_of(scene.vnca.source))
        self.smoke = _only(smoke, frames)
        asked = request.paint_words(
            smoke, look, str(out), request.numbers_text(frames), goes_on=self.goes_on
        )
        return _start(context, _paint_job("paint", self.smoke, asked, out), look)

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """Show the painting."""
        painted = result.show(scene, self.smoke, job.result)
        return f"{len(job.result['files'])} frames painted: {painted.name}"


class VNCA_OT_preview(_Working):
    """Paint the current frame only, as a picture in the panel"""

    bl_idname = "vnca.preview"
    bl_label = "Preview This Frame"
    bl_options = {"REGISTER"}

    def start(self, context: bpy.types.Context) -> Job:
        """Paint the frame into a folder that is forgotten."""
        scene = context.scene
        look, out = source.look_of(scene.vnca), Path(mkdtemp(prefix="vnca-", dir=bpy.app.tempdir))
        smoke = source.smoke_of(scene, out)
        number = scene.frame_current + source.shift_of(scene.vnca.source)
        if smoke.is_sequence and number not in smoke.numbers:
            raise ProblemError(
                f"{smoke.name}: no file for the frame {scene.frame_current}; there are "
                f"{smoke.numbers[0]} to {smoke.numbers[-1]}"
            )
        one = _only(smoke, (number,) if smoke.is_sequence else smoke.numbers)
        words = request.paint_words(smoke, look, str(out), str(number))
        return _start(context, _paint_job("preview", one, words, out), look)

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """The panel shows it."""
        return "Preview painted"


class VNCA_OT_train(_Working):
    """Learn a style from the picture, on the current frame"""

    bl_idname = "vnca.train"
    bl_label = "Train"

    def start(self, context: bpy.types.Context) -> Job:
        """Train in a folder beside the paintings."""
        scene, settings = context.scene, context.scene.vnca
        picture = source.absolute(settings.picture, "the picture")
        if not picture:
            raise ProblemError("Choose a picture to learn from")
        if not Path(picture).is_file():
            raise ProblemError(f"{picture}: there is no such picture")
        out = output_of(scene) / f"style {Path(picture).stem}"
        smoke = source.smoke_of(scene, out)
        number = scene.frame_current + source.shift_of(settings.source)
        number = min(smoke.numbers, key=lambda one: abs(one - number))
        frame = _file_of(smoke, number)
        words = request.train_words(smoke, frame, picture, str(out), settings.preset, settings.seed)
        one = _only(smoke, (number,))
        told = request.job(
            "train",
            words,
            out=str(out),
            sequence=frame,
            staged=[dataclasses.asdict(staged) for staged in one.staged],
        )
        return _start_training(context, told)

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """Paint with it from now on."""
        settings = scene.vnca
        settings.way, settings.model = "MODEL", job.result["model"]
        return f"Style learned: {settings.model}"


class VNCA_OT_check_training(_Working):
    """See whether the Python for training has what it takes"""

    bl_idname = "vnca.check_training"
    bl_label = "Check"
    bl_options = {"REGISTER"}

    def start(self, context: bpy.types.Context) -> Job:
        """Ask it."""
        return _start_training(context, request.job("check", []))

    def finish(self, scene: bpy.types.Scene, job: Job) -> str:
        """What it said."""
        told = job.result
        return f"Training works: vnca {told['version']} in Python {told['python']}"


class VNCA_OT_cancel(bpy.types.Operator):
    """End the work; what is finished is kept"""

    bl_idname = "vnca.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        """Whether something is at work."""
        return current is not None and current.is_running

    def execute(self, _: bpy.types.Context) -> set[str]:
        """Ask the worker to end."""
        if current is not None:
            current.cancel()
        return {"FINISHED"}


class VNCA_OT_log(bpy.types.Operator):
    """Show all that the last worker said, as a text"""

    bl_idname = "vnca.log"
    bl_label = "Show Log"

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        """Whether there was one."""
        return current is not None

    def execute(self, _: bpy.types.Context) -> set[str]:
        """Make the text."""
        assert current is not None
        text = bpy.data.texts.get("vnca log") or bpy.data.texts.new("vnca log")
        text.clear()
        text.write("\n".join(current.last_lines()))
        self.report({"INFO"}, "In the text editor: vnca log")
        return {"FINISHED"}


class VNCA_OT_use_active(bpy.types.Operator):
    """Paint the smoke of the active object"""

    bl_idname = "vnca.use_active"
    bl_label = "Use Active Object"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it."""
        from .settings import is_smoke

        chosen = context.object
        if chosen is None or not is_smoke(None, chosen):
            self.report({"ERROR"}, "The active object is neither a domain of gas nor a volume")
            return {"CANCELLED"}
        context.scene.vnca.source = chosen
        return {"FINISHED"}


def _only(smoke: request.Smoke, numbers: tuple[int, ...]) -> request.Smoke:
    staged = tuple(one for one in smoke.staged if one.number in numbers)
    return dataclasses.replace(smoke, numbers=numbers, staged=staged)


def _file_of(smoke: request.Smoke, number: int) -> str:
    before, hashes, after = smoke.sequence.partition("####")
    return f"{before}{number:04d}{after}" if hashes else smoke.sequence


def _paint_job(
    kind: request.Kind, smoke: request.Smoke, words: list[str], out: Path
) -> dict[str, object]:
    shown = Path(mkdtemp(prefix="vnca-", dir=bpy.app.tempdir)) / "picture.png"
    return request.job(
        kind,
        words,
        out=str(out),
        sequence=smoke.sequence,
        staged=[dataclasses.asdict(staged) for staged in smoke.staged],
        picture=str(shown),
    )


def _start(context: bpy.types.Context, asked: dict[str, object], look: request.Look) -> Job:
    """With the vnca of the extension."""
    runs = interpreter.painter(sys.executable, bpy.app.binary_path, WORKER)
    return _job({**asked, "trains": False, "remedy": "Install the extension anew."}, runs)


def _start_training(context: bpy.types.Context, asked: dict[str, object]) -> Job:
    runs = interpreter.trainer(python_for_training(context), WORKER)
    return _job({**asked, "trains": True, "remedy": interpreter.HOW_TO_TRAIN}, runs)


def _job(asked: dict[str, object], runs: interpreter.Interpreter) -> Job:
    return Job(asked, runs, Path(mkdtemp(prefix="vnca-", dir=bpy.app.tempdir)))


def _progress(job: Job) -> str:
    text = job.what
    if job.total:
        text += f" {job.done}/{job.total}"
    if job.seconds_left is not None:
        text += f", {clock(job.seconds_left)} left"
    return text


def _redraw(context: bpy.types.Context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()


@persistent
def _end_work(*_: object) -> None:
    """Another file is loaded, or Blender quits: what is at work belongs to what is gone."""
    global _running
    _running = None
    if current is not None:
        current.end()


_CLASSES = (
    VNCA_OT_paint,
    VNCA_OT_preview,
    VNCA_OT_train,
    VNCA_OT_check_training,
    VNCA_OT_cancel,
    VNCA_OT_log,
    VNCA_OT_use_active,
)


def register() -> None:
    """Add the operators."""
    for kind in _CLASSES:
        bpy.utils.register_class(kind)
    bpy.app.handlers.load_pre.append(_end_work)


def unregister() -> None:
    """Take them away, and end what is at work."""
    _end_work()
    bpy.app.handlers.load_pre.remove(_end_work)
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)
