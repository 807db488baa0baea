"""Shots with difficult names, and a program that writes down how it was called."""

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from vnca.core.volume import Volume
from vnca.farm.job import Job
from vnca.farm.shots import Chunks, shots_job
from vnca.io import write_smoke

RECORDER = """\
import json, os, sys
calls = {calls!r}
with open(calls, "a", encoding="utf-8") as file:
    print(json.dumps([sys.argv[1:], os.environ.get("PAINT", "")]), file=file)
failing = {failing!r}
if failing and failing[0] in sys.argv:
    with open(calls, encoding="utf-8") as file:
        if sum(failing[0] in line for line in file) <= failing[1]:
            sys.exit(failing[2])
"""
DIFFICULT = 'Дым & co\'s {x} $HOME "2"'
"""A folder whose name no shell, no XML and no Tcl takes as it is."""


@pytest.fixture
def shot(tiny_smoke: Volume, tmp_path: Path) -> Path:
    """A shot of five frames, painted in a style of the library."""
    folder = tmp_path / DIFFICULT
    x, y, z = tiny_smoke.origin
    for number in (1, 2, 3, 5, 6):
        moved = replace(tiny_smoke, origin=(x, y, z + number), frame=number)
        write_smoke(folder / "smoke" / f"ball_{number:04d}.vdb", moved)
    path = folder / "a shot.toml"
    path.write_text(
        'sequence = "smoke"\nout = "painted"\nstyle = "ink"\nrefine = 1\n'
        "[film]\nrows = 32\ncolumns = 32\n"
    )
    return path


@pytest.fixture
def job(shot: Path, recorder: "Recorder") -> Job:
    """A job of two styles in chunks of two frames, as the recorder is called."""
    chunks = Chunks(chunk_size=2, handover="preroll", styles=("ink", "frost"))
    job = shots_job([shot], chunks, recorder.program)
    return job.given({"PAINT": 'b "c" $d'}, 2)


class Recorder:
    """A program in the place of vnca, which writes down how it was called."""

    def __init__(self, folder: Path) -> None:
        self.path, self.calls_path = folder / "re corder.py", folder / "calls"
        self.program = (sys.executable, str(self.path))
        self.fails("", 0, 0)

    def fails(self, word: str, times: int, code: int) -> None:
        """Let calls with a word fail so many times."""
        failing = (word, times, code) if word else ()
        self.path.write_text(RECORDER.format(calls=str(self.calls_path), failing=failing))

    @property
    def calls(self) -> list[tuple[list[str], str]]:
        """Arguments of all calls, and the variable PAINT that they were given."""
        if not self.calls_path.exists():
            return []
        lines = self.calls_path.read_text(encoding="utf-8").splitlines()
        return [tuple(json.loads(line)) for line in lines]


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    return Recorder(tmp_path)


@pytest.fixture
def expected() -> Callable[[Job], dict[str, tuple[list[str], set[str]]]]:
    """Of each task of a job, cut into chunks: its arguments, and what it waits for."""

    def of(job: Job) -> dict[str, Any]:
        return {task.name: ([*task.words], {*task.after}) for task in job.cut().tasks}

    return of
