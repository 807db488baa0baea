"""The command line as a program of its own that can be killed at any moment."""

import json
import random
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from signal import SIGKILL

import pytest

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
        """Run to the end; how often each moment came, and how many seconds it took."""
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
