"""Disks that are full or read-only while a rule is trained."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vnca.cli import main
from vnca.rule.model import Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint, Thrift
from vnca.training.loop import Progress, Trainer

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform != "linux", reason="mounts as Linux has them"),
]
Train = Callable[..., tuple[int, str]]
Eventful = Callable[[Callable[[], object]], None]


@pytest.fixture
def train(
    training: list[object], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Train:
    """Trains, or goes on with a folder; the exit code, and the complaint if there was one."""
    monkeypatch.setattr("vnca.training.run.PREVIEW_SIZE", 64)
    monkeypatch.setattr(Thrift, "share", 0.5)
    monkeypatch.setattr(Thrift, "least_seconds", 0.0)

    def run(*options: object) -> tuple[int, str]:
        capfd.readouterr()
        arguments = ["train"] if "--resume" in options else training
        code = main([str(word) for word in (*arguments, *options)])
        lines = capfd.readouterr().err.splitlines()
        complaints = [line for line in lines if line.startswith("vnca: ")]
        assert lines[-1:] == complaints if code else not complaints
        return code, "".join(complaints)

    return run


@pytest.fixture
def expected(train: Train, tmp_path: Path) -> dict[str, bytes]:
    assert train("--out", tmp_path / "unharmed") == (0, "")
    return contents(tmp_path / "unharmed")


@pytest.fixture
def eventful(monkeypatch: pytest.MonkeyPatch) -> Eventful:
    """Lets something happen before the eighth iteration."""
    improve = Trainer.improve

    def plan(event: Callable[[], object]) -> None:
        def then(self: Trainer) -> Progress:
            if self.iteration == 7:
                event()
            return improve(self)

        monkeypatch.setattr(Trainer, "improve", then)

    return plan


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir() if not p.name.startswith("events.")}


def require_whole(folder: Path) -> None:
    """What it takes to go on is there, and all that is there opens."""
    Checkpoint.load(folder / CHECKPOINT_NAME)
    json.loads((folder / "config.json").read_text())
    assert Model.load(folder).training["iterations"] == 5
    assert not list(folder.glob(".*"))


@pytest.mark.parametrize("free", [0, 4096, 60_000, 100_000])
def test_a_full_disk_ends_training_with_a_line_and_it_goes_on_when_there_is_room(
    train: Train,
    expected: dict[str, bytes],
    eventful: Eventful,
    disk: Path,
    fill: Callable[[int], Path],
    free: int,
) -> None:
    """With no room for the curves, a checkpoint, or a preview."""
    out = disk / "out"
    eventful(lambda: fill(free))
    code, complaint = train("--out", out)
    assert code == 2
    assert f"{out}/" in complaint
    assert "No space left on device" in complaint
    require_whole(out)
    (disk / "filler").unlink()
    eventful(lambda: None)
    assert train("--resume", out) == (0, "")
    assert contents(out) == expected


def test_a_disk_that_is_full_from_the_start_is_told(
    train: Train, disk: Path, fill: Callable[[int], Path]
) -> None:
    out = disk / "out"
    filler = fill(8192)
    code, complaint = train("--out", out)
    assert code == 2
    assert "No space left on device" in complaint
    assert not (out / CHECKPOINT_NAME).exists()
    filler.unlink()
    assert train("--out", out) == (0, "")
    assert Model.load(out).training["iterations"] == 12


def test_a_read_only_disk_is_refused_before_work(
    train: Train, disk: Path, remount: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vnca.recipe.smoke.read_style", lambda _: pytest.fail("worked"))
    remount("ro")
    code, complaint = train("--out", disk / "out")
    assert code == 2
    assert f"{disk / 'out'}: cannot be written" in complaint
