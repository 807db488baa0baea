"""The script for a GPU, tried out on the CPU with small settings."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "benchmarks" / "device" / "run_all.sh"
SMALL = """
base = "draft"
[view]
size = 32
[rule]
channels = 6
hidden = 16
[appearance]
samples = 64
[motion]
size = 32
[pool]
size = 2
"""


def run(out: Path, *parts: str, **settings: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "OUT": str(out), "PYTHON": sys.executable, "DEVICE": "cpu"}
    return subprocess.run(
        [SCRIPT, *parts], env={**environment, **settings}, capture_output=True, text=True
    )


def test_it_says_what_the_machine_has(tmp_path: Path) -> None:
    done = run(tmp_path, "check")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "on cpu, auto takes native" in done.stdout


@pytest.mark.slow
def test_it_trains_paints_and_measures(tmp_path: Path) -> None:
    preset = tmp_path / "small.toml"
    preset.write_text(SMALL)
    small = f"--resolution 16 --iterations 4 --size 64 --preset {preset}"
    done = run(tmp_path, "check", "train", "paint", "evaluate", WHOLE=small)
    assert done.returncode == 0, done.stdout
    assert "off by 0.0e+00 from the CPU's" in (tmp_path / "paint.log").read_text()
    assert "'motion'" in (tmp_path / "train.log").read_text()


def test_nothing_is_timed_where_something_is_wrong(tmp_path: Path) -> None:
    done = run(tmp_path, "tests", "bench", TESTS="tests/nowhere")
    assert done.returncode == 1
    assert "tests: failed" in done.stdout
    assert "== bench: not run, since what is computed is wrong" in done.stdout
    assert not (tmp_path / "bench.log").exists()


def test_without_time_parts_are_named_and_fail(tmp_path: Path) -> None:
    done = run(tmp_path, "check", "bench", SECONDS_LEFT="3")
    assert done.returncode == 1
    assert "== check: not run, no time left" in done.stdout
    assert "== bench: not run" in done.stdout


def test_a_part_ends_when_time_is_up(tmp_path: Path) -> None:
    """Importing torch alone takes longer than a second."""
    slow = tmp_path / "slow"
    slow.write_text(f"#!/bin/sh\nsleep 60\n{sys.executable}\n")
    slow.chmod(0o755)
    done = run(tmp_path, "check", SECONDS_LEFT="6", PYTHON=str(slow))
    assert done.returncode == 1
    assert "check: failed" in done.stdout


def test_an_unknown_part_is_refused(tmp_path: Path) -> None:
    done = run(tmp_path, "benhc")
    assert done.returncode == 2
    assert "benhc: no such part" in done.stdout
