"""Stylizing that is killed at any moment and gone on with ends in the very same files."""

import random
import sys
from pathlib import Path
from typing import Any

import pytest

from vnca.io.vdb import open_vdb

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL"),
]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def require_whole(folder: Path) -> None:
    """Every file under a final name opens, and its grids can be read."""
    for path in folder.glob("[!.]*") if folder.is_dir() else ():
        with open_vdb(path) as file:
            assert {"density", "Cd"} <= set(file.grids)
            for header in file.grids.values():
                header.read()


def survive(program: Any, stylizing: list[object], folder: Path, *, kills: int, seed: int) -> None:
    """Kill one painting after the other, some several times, and compare how they end."""
    draw = random.Random(seed)
    unharmed = [*stylizing, "--out", folder / "unharmed"]
    moments = program.finish(unharmed)
    expected = contents(folder / "unharmed")
    killed, paintings = 0, 0
    while killed < kills:
        out = folder / f"{paintings}"
        arguments = [*stylizing, "--out", out]
        for _ in range(draw.randint(1, 3)):
            if killed < kills and program.kill(arguments, moments, draw):
                killed += 1
                require_whole(out)
            arguments = [*stylizing, "--out", out, "--resume"]
        program.finish(arguments)
        assert contents(out) == expected, f"painting {paintings}, seed {seed}"
        paintings += 1
    print(f"{killed} kills of {paintings} paintings, all ended with the same {len(expected)} files")


def test_three_kills(program: Any, stylizing: list[object], tmp_path: Path) -> None:
    survive(program, stylizing, tmp_path, kills=3, seed=1)


def test_two_kills_of_a_painting_by_tiles(
    program: Any, stylizing: list[object], tmp_path: Path
) -> None:
    survive(program, [*stylizing, "--tile", 16], tmp_path, kills=2, seed=3)


@pytest.mark.slow
def test_twenty_kills_of_paintings_by_tiles(
    program: Any, stylizing: list[object], tmp_path: Path
) -> None:
    survive(program, [*stylizing, "--tile", 16, "--halo", 3], tmp_path, kills=20, seed=4)


@pytest.mark.slow
def test_fifty_kills(program: Any, stylizing: list[object], tmp_path: Path) -> None:
    survive(program, stylizing, tmp_path, kills=50, seed=2)
