"""Any rank or chunk of a painting that is killed at any moment: gone on with, to the same files."""

import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from signal import SIGKILL
from typing import Any

import pytest
from tests.cli.test_stylize_ranks import launcher, ranks_of
from tests.faults.test_stylizing_kills import contents, require_whole

pytestmark = pytest.mark.faults
CHUNKS = (("1-3", None, "a"), ("4-6", "a", "b"), ("7-8", "b", None))
"""Their frames, and by which file the state is handed over."""


def started(size: int, arguments: list[object]) -> "subprocess.Popen[str]":
    program = launcher(size) if size > 1 else [sys.executable]
    command = [str(word) for word in (*program, "-m", "vnca", *arguments)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)


def kill_any(job: "subprocess.Popen[str]", size: int, seconds: float, draw: random.Random) -> bool:
    """Kill one of its ranks after some time; False if it came to its end before."""
    time.sleep(seconds)
    ranks = ranks_of(job.pid) if size > 1 else [job.pid]
    if job.poll() is not None or not ranks:
        return False
    os.kill(draw.choice(ranks), SIGKILL)
    return True


def finish(size: int, arguments: list[object]) -> float:
    begun = time.monotonic()
    with started(size, arguments) as job:
        assert job.stderr is not None
        said = job.stderr.read()
    assert job.returncode == 0, said
    return time.monotonic() - begun


def survive(
    paint: Callable[[Path], list[list[object]]], folder: Path, kills: int, seed: int
) -> None:
    """Kill paintings, each a list of jobs one after the other, and compare how they end."""
    draw = random.Random(seed)
    longest = max(finish(2, arguments) for arguments in paint(folder / "unharmed"))
    expected = contents(folder / "unharmed")
    killed, paintings = 0, 0
    while killed < kills:
        out = folder / f"{paintings}"
        for arguments in paint(out):
            again = arguments
            while killed < kills and draw.random() < 0.7:
                size = draw.choice((1, 2, 3))
                with started(size, again) as job:
                    hit = kill_any(job, size, draw.uniform(0, longest), draw)
                    assert job.stderr is not None
                    said = job.stderr.read()
                assert "Traceback" not in said, said
                require_whole(out)
                again = [*arguments, "--resume"]
                if hit:
                    killed += 1
            finish(draw.choice((1, 2, 3)), [*arguments, "--resume"])
        assert contents(out) == expected, f"painting {paintings}, seed {seed}"
        shutil.rmtree(out)
        paintings += 1
    print(f"{killed} kills in {paintings} paintings, all ended with the same {len(expected)} files")


@pytest.mark.slow
def test_twenty_kills_of_ranks_and_chunks(stylizing: list[Any], tmp_path: Path) -> None:
    tiles = [*stylizing, "--tile", 16, "--halo", 4]

    def paint(out: Path) -> list[list[object]]:
        jobs = []
        for frames, before, after in CHUNKS:
            states = {name: f"{out}_{name}.safetensors" for name in (before, after)}
            handed = [] if before is None else ["--state-in", states[before]]
            handed += [] if after is None else ["--state-out", states[after]]
            jobs.append([*tiles, "--out", out, "--chunk", frames, *handed])
        return jobs

    survive(paint, tmp_path, kills=20, seed=5)
