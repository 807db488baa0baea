# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker: how far it has come, how it is ended, and what it left when it died."""

import json
import math
import os
import subprocess
import time
from pathlib import Path
from typing import IO, Any

from .interpreter import Interpreter

PATIENCE = 3.0
"""Seconds that a cancelled worker has to write down what it has; nobody waits for that."""
_LOG_LINES = 12


class Job:
    """A worker at work. It writes to files, which are read without waiting.

    Attributes:
        kind: What is asked: `paint`, `preview`, `train` or `check`.
        state: `running`, `done`, `failed` or `cancelled`.
        what: What it is doing, such as `painting`.
        done: How many units are finished.
        total: How many there are; 0 while that is not known.
        seconds_left: None while that is not known.
        picture: The latest picture of the work, if there is one.
        pictures: How many there were.
        notes: What was worth telling.
        message: Why it failed, a line.
        result: What it told at the end.
        log: File of all that it said.
    """

    def __init__(self, asked: dict[str, Any], interpreter: Interpreter, folder: Path) -> None:
        """Start it.

        Args:
            asked: As `request.job` makes it.
            interpreter: What runs it.
            folder: A new folder for its files.
        """
        self.kind: str = asked["kind"]
        self.state, self.message = "running", ""
        self.what, self.done, self.total = "starting", 0, 0
        self.seconds_left: float | None = None
        self.picture: str | None = None
        self.pictures = 0
        self.notes: list[str] = []
        self.result: dict[str, Any] = {}
        folder.mkdir(parents=True, exist_ok=True)
        self.log = folder / "log.txt"
        (folder / "job.json").write_text(json.dumps(asked), encoding="utf-8")
        self._rest, self._deadline = b"", math.inf
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                [*interpreter.words, str(folder / "job.json")],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=log,
                env=interpreter.variables(),
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        self._said: IO[bytes] = self.log.open("rb")

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether it is at work still."""
        return self.state == "running"

    @property
    def fraction(self) -> float:
        """How far the work has come, from 0 to 1."""
        return min(self.done / self.total, 1.0) if self.total else 0.0

    @property
    def seen(self) -> tuple[object, ...]:
        """What is shown of it: equal as long as nothing new is to be seen."""
        left = None if self.seconds_left is None else round(self.seconds_left)
        return self.state, self.what, self.done, self.total, left, self.pictures, len(self.notes)

    def poll(self) -> bool:
        """Read what it said since, without waiting; whether its process is there still."""
        if self._said.closed:
            return False
        code = self._process.poll()
        self._read()
        if code is None:
            if time.monotonic() > self._deadline:
                self._process.kill()
            return True
        self._said.close()
        self._process.stdin.close()
        if self.is_running:
            self.state = "done" if code == 0 and self.result else "failed"
        if self.state == "failed":
            self.message = self.message or _died(code)
        return False

    def cancel(self) -> None:
        """It is cancelled from now on; its process ends by itself, or `poll` ends it later."""
        if self.is_running:
            self.state = "cancelled"
            self._deadline = time.monotonic() + PATIENCE
            self._process.stdin.close()  # the worker waits for that

    def end(self) -> None:
        """Cancel it if it is running, and end its process at once."""
        self.cancel()
        self._process.kill()
        self._process.wait()
        self.poll()

    def last_lines(self) -> list[str]:
        """The end of what it said."""
        lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return lines[-_LOG_LINES:]

    def _read(self) -> None:
        *lines, self._rest = (self._rest + self._said.read()).split(b"\n")
        for line in lines:
            try:
                told = json.loads(line)
            except ValueError:
                continue  # Python's own words; they are in the log
            if isinstance(told, dict):
                self._hear(told)

    def _hear(self, told: dict[str, Any]) -> None:
        kind = told.get("event")
        if kind == "progress":
            self.what, self.done, self.total = told["what"], told["done"], told["total"]
            self.seconds_left = told.get("seconds_left")
        elif kind == "note":
            self.notes.append(str(told.get("text", "")))
        elif kind == "picture":
            self.picture = told["path"]
            self.pictures += 1
        elif kind == "error":
            self.message = str(told.get("message", ""))
        elif kind == "finished":
            self.result = told


def _died(code: int) -> str:
    how = f"signal {-code}" if code < 0 and os.name == "posix" else f"code {code}"
    return f"The worker ended unexpectedly ({how}); its log tells more"


def clock(seconds: float) -> str:
    """Time as `0:05` or `1:02:03`."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}" if hours else f"{minute}:{second:02}"
