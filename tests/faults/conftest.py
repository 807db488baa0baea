"""The command line as a program of its own that can be killed at any moment."""

import json
import random
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from signal import SIGKILL

import numpy as np
import pytest

from vnca.automaton.model import Model
from vnca.automaton.rule import Rule, RuleConfig, Scales
from vnca.io.smoke import write_smoke
from vnca.volume import Volume

MOMENTS = ("torn", "written", "renamed", "seconds")


class Program:
    """Runs `vnca` as `killed.py` does, which tells what the moments are."""

    def run(
        self, arguments: Sequence[object], moment: str = "never", number: float = 0
    ) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, Path(__file__).with_name("killed.py"), moment, number]
        return subprocess.run(
            [str(word) for word in (*command, *arguments)],
            capture_output=True,
            text=True,
            timeout=600,
        )

    def finish(self, arguments: Sequence[object]) -> dict[str, float]:
        """Run to the end; how often each moment came, and what it took: see `killed.py`."""
        done = self.run(arguments)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    def kill(
        self, arguments: Sequence[object], moments: dict[str, float], draw: random.Random
    ) -> bool:
        """Kill a run at a random moment of those that an unharmed run had.

        Returns:
            False if it came to its end before.
        """
        moment = draw.choice(MOMENTS)
        most = moments[moment]
        number = draw.uniform(0, most) if moment == "seconds" else draw.randint(1, int(most))
        done = self.run(arguments, moment, number)
        assert done.returncode in (0, -SIGKILL), done.stderr
        return done.returncode != 0


@pytest.fixture(scope="session")
def program() -> Program:
    return Program()


@pytest.fixture(scope="session")
def stylizing(tmp_path_factory: pytest.TempPathFactory) -> list[object]:
    """A made-up rule and smoke that rises: the arguments of stylizing without its output."""
    folder = tmp_path_factory.mktemp("inputs")
    values = np.random.default_rng(7)
    x, y, z = np.meshgrid(*[np.arange(20) - 9.5] * 3, indexing="ij")
    for number in range(1, 9):
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
