# SPDX-License-Identifier: GPL-3.0-or-later
"""What has in common whatever is done by a worker: begun, followed, cancelled, ended.

The window stays free: work is done by a process of its own, which a timer asks how far it has
come. Without a window (`blender --background`) the operators wait for it instead.
"""

import sys
import time
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import interpreter
from .job import Job, clock
from .problem import ProblemError
from .settings import python_for_training

WORKER = Path(__file__).parent / "worker"
TICK = 0.1
"""Seconds between two looks at the work."""
_PANELS = {("VIEW_3D", "UI"), ("PROPERTIES", "WINDOW")}
"""Where the panel is: areas, and regions of them."""

current: Job | None = None
"""What is at work, or was last."""
_running: "Working | None" = None


class Working(bpy.types.Operator):
    """An operator whose work is a worker's."""

    bl_options = {"REGISTER", "UNDO"}
    kept = "what was painted is kept, and Go On goes on"
    """What is told when it is cancelled."""
    _timer: bpy.types.Timer | None = None
    _scene = ""
    _seen: tuple[object, ...] = ()

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
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look at the work; Esc cancels it."""
        job = current
        if job is None or _running is not self:
            self._tidy(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS" and job.is_running:
            job.cancel()
            _redraw(context)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        is_there = job.poll()
        if (seen := job.seen) != self._seen or not is_there:
            self._seen = seen
            _redraw(context)
        if is_there:
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
        if current is not None:
            current.end()  # one that was cancelled may be writing still
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
            self.report({"WARNING"}, f"Cancelled; {self.kept}")
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
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None


def begin_painting(asked: dict[str, Any]) -> Job:
    """Begin a job with the vnca of the extension.

    Raises:
        ProblemError: If there is none.
    """
    runs = interpreter.painter(sys.executable, bpy.app.binary_path, WORKER)
    return _job({**asked, "trains": False, "remedy": "Install the extension anew."}, runs)


def begin_training(context: bpy.types.Context, asked: dict[str, Any]) -> Job:
    """Begin a job with the Python that trains.

    Raises:
        ProblemError: If there is none.
    """
    runs = interpreter.trainer(python_for_training(context), WORKER)
    return _job({**asked, "trains": True, "remedy": interpreter.HOW_TO_TRAIN}, runs)


def new_folder() -> Path:
    """A folder that Blender removes when it ends."""
    return Path(mkdtemp(prefix="vnca-", dir=bpy.app.tempdir))


def _job(asked: dict[str, Any], runs: interpreter.Interpreter) -> Job:
    return Job(asked, runs, new_folder())


def _progress(job: Job) -> str:
    text = job.what
    if job.total:
        text += f" {job.done}/{job.total}"
    if job.seconds_left is not None:
        text += f", {clock(job.seconds_left)} left"
    return text


def _redraw(context: bpy.types.Context) -> None:
    """Draw the panel anew, and nothing beside it: a view of smoke may take its time."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if (area.type, region.type) in _PANELS:
                    region.tag_redraw()


@persistent
def end_work(*_: object) -> None:
    """Another file is loaded, or Blender quits: what is at work belongs to what is gone."""
    global _running
    _running = None
    if current is not None:
        current.end()


def register() -> None:
    """Work ends with the file that it is for."""
    bpy.app.handlers.load_pre.append(end_work)


def unregister() -> None:
    """End what is at work."""
    end_work()
    bpy.app.handlers.load_pre.remove(end_work)
