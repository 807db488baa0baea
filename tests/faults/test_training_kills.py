"""Training that is killed at any moment and gone on with ends in the very same model."""

import json
import random
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL"),
]


@pytest.fixture(scope="module")
def warm(program: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """As `program`, without the seconds that importing torch takes each time: see `warm.py`."""
    printed = tmp_path_factory.mktemp("printed") / "printed"
    command = [sys.executable, str(Path(__file__).with_name("warm.py"))]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, text=True, bufsize=1, **pipes) as process:  # type: ignore[call-overload]

        class Warm(type(program)):
            def run(
                self, arguments: Sequence[object], moment: str = "never", number: float = 0
            ) -> subprocess.CompletedProcess[str]:
                words = [str(word) for word in (printed, moment, number, *arguments)]
                print(json.dumps(words), file=process.stdin, flush=True)
                code = int(process.stdout.readline())
                output = printed.read_text()
                return subprocess.CompletedProcess(words, code, output, output)

        yield Warm()
        process.stdin.close()


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the curves, which hold the time of day."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if not p.name.startswith("events.")}


def curves(folder: Path) -> dict[str, list[tuple[int, float]]]:
    """What TensorBoard shows."""
    events = EventAccumulator(str(folder), purge_orphaned_data=True).Reload()
    return {
        tag: [(point.step, point.value) for point in events.Scalars(tag)]
        for tag in events.Tags()["scalars"]
    }


def require_whole(folder: Path) -> None:
    """Every file under a final name opens."""
    for path in folder.glob("[!.]*") if folder.is_dir() else ():
        if path.name == MODEL_NAME:
            Model.load(path)
        elif path.name == CHECKPOINT_NAME:
            Checkpoint.load(path)
        elif path.suffix == ".png":
            with Image.open(path) as picture:
                picture.load()
        elif path.suffix == ".json":
            json.loads(path.read_text())
        else:
            assert path.name.startswith("events.")


def survive(program: Any, training: list[object], folder: Path, *, kills: int, seed: int) -> None:
    """Kill one training after the other, some several times, and compare how they end."""
    draw = random.Random(seed)
    moments = program.finish([*training, "--out", folder / "unharmed"])
    expected, shown = contents(folder / "unharmed"), curves(folder / "unharmed")
    assert {MODEL_NAME, "config.json", "preview_000012.png"} < expected.keys()
    assert CHECKPOINT_NAME not in expected
    killed = runs = 0
    while killed < kills:
        out = folder / f"{runs}"
        arguments = [*training, "--out", out]
        for _ in range(draw.randint(1, 3)):
            if killed < kills and program.kill(arguments, moments, draw):
                killed += 1
                require_whole(out)
            if (out / CHECKPOINT_NAME).exists() or (out / MODEL_NAME).exists():
                arguments = ["train", "--resume", out]
        program.finish(arguments)
        assert contents(out) == expected, f"training {runs}, seed {seed}"
        assert curves(out) == shown
        runs += 1
    print(f"{killed} kills of {runs} trainings, all ended with the same {len(expected)} files")


def test_three_kills(warm: Any, training: list[object], tmp_path: Path) -> None:
    survive(warm, training, tmp_path, kills=3, seed=1)


@pytest.mark.slow
def test_forty_five_kills(warm: Any, training: list[object], tmp_path: Path) -> None:
    survive(warm, training, tmp_path, kills=45, seed=2)


@pytest.mark.slow
def test_five_kills_of_a_program_that_starts_anew(
    program: Any, training: list[object], tmp_path: Path
) -> None:
    survive(program, training, tmp_path, kills=5, seed=3)
