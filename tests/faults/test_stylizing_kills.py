"""Stylizing that is killed at any moment and gone on with ends in the very same files."""

import random
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.automaton.model import Model
from vnca.automaton.rule import Rule, RuleConfig, Scales
from vnca.io.smoke import write_smoke
from vnca.io.vdb import open_vdb
from vnca.volume import Volume

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL"),
]
FRAMES = 8


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> list[object]:
    """A made-up rule and smoke that rises: the arguments of stylizing without its output."""
    folder = tmp_path_factory.mktemp("inputs")
    values = np.random.default_rng(7)
    x, y, z = np.meshgrid(*[np.arange(20) - 9.5] * 3, indexing="ij")
    for number in range(1, FRAMES + 1):
        radius = 6 + 0.5 * number
        density = np.clip(radius - np.sqrt(x**2 + y**2 + z**2), 0, 1).astype(np.float32)
        density *= values.uniform(0.5, 1.5, density.shape).astype(np.float32)
        velocity = values.normal(0, 0.5, (*density.shape, 3)).astype(np.float32)
        volume = Volume(density, velocity, (0, 0, number), np.eye(4), number)
        write_smoke(folder / "smoke" / f"puff_{number:04d}.vdb", volume)
    rule = Rule.initial(RuleConfig(hidden=32), Scales(), seed=3)
    output = values.normal(0, 0.02, rule.output.shape).astype(np.float32)
    Model(replace(rule, output=output)).save(folder / "rule.safetensors")
    quick = ("--warmup", 16, "--steps-per-frame", 8)
    return ["stylize", folder / "rule.safetensors", folder / "smoke", *quick]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def require_whole(folder: Path) -> None:
    """Every file under a final name opens, and its grids can be read."""
    for path in folder.glob("[!.]*") if folder.is_dir() else ():
        with open_vdb(path) as file:
            assert {"density", "Cd"} <= set(file.grids)
            for header in file.grids.values():
                header.read()


def survive(program: Any, inputs: list[object], folder: Path, *, kills: int, seed: int) -> None:
    """Kill one painting after the other, some several times, and compare how they end."""
    draw = random.Random(seed)
    unharmed = [*inputs, "--out", folder / "unharmed"]
    moments = program.finish(unharmed)
    expected = contents(folder / "unharmed")
    assert len(expected) == FRAMES
    killed, paintings = 0, 0
    while killed < kills:
        out = folder / f"{paintings}"
        arguments = [*inputs, "--out", out]
        for _ in range(draw.randint(1, 3)):
            if killed < kills and program.kill(arguments, moments, draw):
                killed += 1
                require_whole(out)
            arguments = [*inputs, "--out", out, "--resume"]
        program.finish(arguments)
        assert contents(out) == expected, f"painting {paintings}, seed {seed}"
        paintings += 1
    print(f"{killed} kills of {paintings} paintings, all ended with the same {FRAMES} files")


def test_three_kills(program: Any, inputs: list[object], tmp_path: Path) -> None:
    survive(program, inputs, tmp_path, kills=3, seed=1)


@pytest.mark.slow
def test_fifty_kills(program: Any, inputs: list[object], tmp_path: Path) -> None:
    survive(program, inputs, tmp_path, kills=50, seed=2)
