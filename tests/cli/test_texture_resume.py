"""Training of a texture that was interrupted, and going on with it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh

from vnca.core.errors import Terminated
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME
from vnca.training.loop import Progress, Trainer

Vnca = Callable[..., Any]
Begin = Callable[..., Path]

TINY = (
    *("--block", 16, "--slice.size", 32, "--slice.count", 2, "--hidden", 8, "--channels", 6),
    *("--iterations", 4, "--preview-every", 3, "--shortest-rollout", 2, "--longest-rollout", 3),
    *("--appearance.samples", 64, "--appearance.layers", "stem", "block1", "--device", "cpu"),
)


@pytest.fixture(autouse=True)
def small_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of the time, and nothing here is about how they look."""
    monkeypatch.setattr("vnca.training.run.PREVIEW_SIZE", 32)


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    trimesh.creation.icosphere(2).export(tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


@pytest.fixture
def begin(vnca: Vnca, style: Path, mesh: Path, tmp_path: Path) -> Begin:
    """Trains for four iterations in a folder; with an interruption, after two of them."""
    improve = Trainer.improve

    def run(name: str, interruption: type[BaseException] | None = None) -> Path:
        def interrupted(self: Trainer) -> Progress:
            if self.iteration == 2 and interruption is not None:
                raise interruption
            return improve(self)

        folder = tmp_path / name
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Trainer, "improve", interrupted)
            outcome = vnca("texture", "train", style, "--out", folder, "--mesh", mesh, *TINY)
        codes = {None: 0, KeyboardInterrupt: 130, Terminated: 143}
        assert outcome.code == codes[interruption], outcome.err
        if interruption is not None:
            assert f"to go on: vnca texture train --resume {folder}" in outcome.err
        return folder

    return run


def contents(run: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in run.iterdir() if not p.name.startswith("events.")}


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, Terminated])
def test_a_texture_gone_on_with_ends_as_if_it_had_not_been_interrupted(
    vnca: Vnca, begin: Begin, interruption: type[BaseException]
) -> None:
    whole, run = begin("whole"), begin("run", interruption)
    assert Model.load(run).training["iterations"] == 2
    assert (run / CHECKPOINT_NAME).exists()
    assert vnca("texture", "train", "--resume", run).code == 0
    # The preview of where it was interrupted stays.
    assert contents(run) == contents(whole) | {
        "preview_000002.png": (run / "preview_000002.png").read_bytes()
    }
    assert "come to its end" in vnca("texture", "train", f"--resume={run}").err


def test_moved_inputs_are_found_where_they_are_said_to_be_and_changed_ones_refused(
    vnca: Vnca, begin: Begin, mesh: Path, style: Path
) -> None:
    whole, run = begin("whole"), begin("run", KeyboardInterrupt)
    there = mesh.rename(mesh.with_name("moved.obj"))
    style = style.rename(style.with_name("moved.png"))
    resume = ("texture", "train", "--resume", run)
    assert "no such file" in vnca(*resume, "--style", style).complaint
    trimesh.creation.box().export(mesh)
    assert "the mesh changed" in vnca(*resume, "--style", style).complaint
    assert vnca(*resume, "--style", style, "--mesh", there).code == 0
    ours, theirs = (Model.load(folder).rule for folder in (run, whole))
    assert ours.output.tobytes() == theirs.output.tobytes()


def test_what_another_command_began_is_told(vnca: Vnca, begin: Begin) -> None:
    run = begin("run", KeyboardInterrupt)
    complaint = vnca("train", "--resume", run).complaint
    assert f"go on with vnca texture train --resume {run}" in complaint


def test_an_interrupted_texture_is_not_overwritten_by_mistake(
    vnca: Vnca, begin: Begin, style: Path
) -> None:
    run = begin("run", KeyboardInterrupt)
    (run / MODEL_NAME).unlink()
    complaint = vnca("texture", "train", style, "--out", run, *TINY).complaint
    assert f"--resume {run}" in complaint
