"""The command line as a program of its own that can be killed, and a disk that can be filled."""

import json
import random
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from signal import SIGKILL

import numpy as np
import pytest
from PIL import Image

from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.rule import Rule, RuleConfig, Scales
from vnca.rule.model import Model

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


@pytest.fixture(scope="session")
def training(tiny_smoke: Volume, tmp_path_factory: pytest.TempPathFactory) -> list[object]:
    """A little smoke and a picture: the arguments of a short training without its output."""
    folder = tmp_path_factory.mktemp("inputs")
    write_smoke(folder / "ball_0001.vdb", tiny_smoke)
    with Image.open(str(files("vnca.data") / "vangogh_cafe_terrace.webp")) as image:
        image.convert("RGB").resize((40, 50)).save(folder / "style.png")
    quick = (
        *("--iterations", 12, "--preview-every", 5, "--hidden", 8, "--channels", 6),
        *("--appearance.layers", "stem", "block1", "--appearance.samples", 64),
        *("--view.size", 32, "--shortest-rollout", 2, "--longest-rollout", 5),
        *("--pool.size", 4, "--device", "cpu", "--texture", 0),
    )
    return ["train", folder / "ball_0001.vdb", folder / "style.png", *quick]


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of its own, of two megabytes."""
    place = tmp_path / "disk"
    place.mkdir()
    if not mounted("-t", "tmpfs", "-o", "size=2m", "tmpfs", place):
        pytest.skip("no right to mount a small disk")
    yield place
    subprocess.run(["umount", "--lazy", place], check=True)


@pytest.fixture
def remount(disk: Path) -> Callable[[str], None]:
    """Makes the disk read-only, `ro`, or writable again, `rw`."""

    def change(how: str) -> None:
        assert mounted("-o", f"remount,{how}", disk)

    return change


@pytest.fixture
def fill(disk: Path) -> Callable[[int], Path]:
    """Leaves so many bytes on the disk; gives the file that takes the others."""

    def leave(free: int) -> Path:
        filler = disk / "filler"
        filler.write_bytes(bytes(shutil.disk_usage(disk).free - free))
        return filler

    return leave


def mounted(*arguments: object) -> bool:
    try:
        done = subprocess.run(["mount", *map(str, arguments)], capture_output=True)
    except FileNotFoundError:
        return False
    return done.returncode == 0
