# SPDX-License-Identifier: GPL-3.0-or-later
"""What paints and trains beside Blender: vnca, told by a file, telling as JSON what happens.

`python worker JOB.json`. It ends when its standard input is closed, and so with Blender.
"""

import io
import json
import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from importlib.util import find_spec
from pathlib import Path

if "--" in sys.argv:  # run by Blender itself, where Python is no program of its own
    sys.path.insert(0, str(Path(__file__).parent))

PICTURE_SECONDS = 2.0
"""Least time between two pictures of the work."""
GRACE = 5.0
"""Seconds after which a worker whose Blender is gone ends whatever it does."""


def tell(kind, **facts):
    """An event, as those of `--json-progress`."""
    print(json.dumps({"event": kind, **facts}), file=sys.__stderr__, flush=True)


class Told(io.TextIOBase):
    """Passes on what vnca tells, and shows the work now and then."""

    def __init__(self, show):
        self._line, self._show, self._shown = "", show, 0.0

    def write(self, text):
        """Pass it on; show the work if it tells of progress."""
        sys.__stderr__.write(text)
        *lines, self._line = (self._line + text).split("\n")
        if any('"event": "progress"' in line for line in lines):
            sys.__stderr__.flush()
            now = time.monotonic()
            if now - self._shown > PICTURE_SECONDS:
                self._show()
                self._shown = time.monotonic()
        return len(text)

    def flush(self):
        """Pass that on too."""
        sys.__stderr__.flush()

    def fileno(self):
        """That of the stream that it is passed on to."""
        return sys.__stderr__.fileno()


def end_with_blender(*, waits):
    """End when the standard input is closed: as SIGTERM ends vnca, and then at all events.

    Args:
        waits: Whether a SIGTERM waits for the frame in work, which a second one ends.
    """

    def wait():
        while os.read(0, 1024):  # through no buffer, whose lock would outlive the interpreter
            pass
        for _ in range(1 + waits):
            if callable(signal.getsignal(signal.SIGTERM)):
                interrupt_main(signal.SIGTERM)
                time.sleep(0.1)
        time.sleep(GRACE)
        os._exit(143)

    threading.Thread(target=wait, daemon=True).start()


def latest(folder, pattern):
    """The newest file of a folder; None if there is none yet."""
    paths = [path for path in Path(folder).glob(pattern) if not path.name.startswith(".")]
    return max(paths, key=lambda path: path.stat().st_mtime_ns, default=None)


def paint(job):
    """Paint frames, and show the latest."""
    import picture
    import staging

    from vnca.cli import main

    folder = Path(job["out"]) / "staged"
    if job["anew"]:
        staging.clear(folder)
    staging.stage(job["staged"], folder, tell, mesh=job["mesh"])
    painted, shown = Path(job["out"]) / "painted", Path(job["picture"])

    def show(path=None):
        path = path or latest(painted, "*.vdb")
        if path is not None:
            picture.draw(path, shown, **job["shown"])
            tell("picture", path=str(shown))

    sys.stderr = Told(show)
    code = main(job["words"])
    sys.stderr = sys.__stderr__
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a moment more, and all is done
    if code == 0:
        files = sorted(str(path) for path in painted.glob("*.vdb") if path.name[0] != ".")
        last = latest(painted, "*.vdb")
        show(last)
        tell("finished", files=files, picture=str(shown), **picture.facts(last))
        staging.clear(folder)
    return code


def train(job):
    """Learn a style, and show what vnca shows of it."""
    import picture
    import staging

    from vnca.cli import main

    run = Path(job["out"])
    folder = run / "staged"
    staging.stage(job["staged"], folder, tell)
    # Of what was learned before it was gone on with, if it is.
    shown = latest(run, "**/preview_*.png")

    def show():
        nonlocal shown
        path = latest(run, "**/preview_*.png")
        if path is not None and path != shown:
            shown = path
            picture.fold(path, job["picture"])
            tell("picture", path=job["picture"])

    sys.stderr = Told(show)
    try:
        code = main(job["words"])
    finally:
        sys.stderr = sys.__stderr__
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if not (run / "checkpoint.safetensors").exists():  # or going on needs it
            staging.clear(folder)
    if code == 0:
        show()
        tell("finished", model=str(run))
    return code


def check(job):
    """Tell what is installed here, and whether the network that compares pictures is."""
    import torch

    import vnca
    from vnca.core.errors import VncaError
    from vnca.features import load_network

    try:
        load_network("efficientnet", torch.device("cpu"))
    except VncaError as error:
        tell("error", message=f"{sys.executable}: {error}", exit_code=2)
        return 2
    tell("finished", version=vnca.__version__, python=sys.version.split()[0])
    return 0


def missing(job):
    """What this Python lacks for a job, as a line; empty if nothing."""
    needed = ["vnca", "numpy"] + ["torch"] * job["trains"]
    absent = [name for name in needed if find_spec(name) is None]
    if not absent:
        return ""
    return f"{sys.executable}: {', '.join(absent)} missing there. {job['remedy']}"


def run(path):
    """Do the job; the exit code is vnca's."""
    job = json.loads(Path(path).read_text(encoding="utf-8"))
    # Until vnca is at work there is nothing to be written down.
    signal.signal(signal.SIGTERM, lambda *_: os._exit(143))
    end_with_blender(waits=job["kind"] != "train")
    if absent := missing(job):
        tell("error", message=absent, exit_code=2)
        return 2
    try:
        return {"train": train, "check": check}.get(job["kind"], paint)(job)
    except Exception as fault:
        sys.stderr = sys.__stderr__
        tell("error", message=f"A fault of the extension: {fault!r}", exit_code=1)
        raise


if __name__ == "__main__":
    sys.exit(run(sys.argv[-1]))
