"""Training that was interrupted, and going on with it."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from PIL import Image
from safetensors.torch import load_file, save_file

from vnca.core.errors import Terminated
from vnca.losses.appearance import Appearance, AppearanceLoss
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME
from vnca.training.loop import Progress, Trainer

Vnca = Callable[..., Any]
Begin = Callable[..., Path]


@pytest.fixture(autouse=True)
def small_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of the time, and nothing here is about how they look."""
    monkeypatch.setattr("vnca.training.run.PREVIEW_SIZE", 32)


@pytest.fixture
def begin(
    vnca: Vnca,
    frame: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Begin:
    """Trains for four iterations in a folder; with an interruption, after two of them."""
    improve = Trainer.improve

    def run(name: str, interruption: type[BaseException] | None = None) -> Path:
        def interrupted(self: Trainer) -> Progress:
            progress = improve(self) if self.iteration < 2 or interruption is None else None
            if progress is None:
                assert interruption is not None
                raise interruption
            return progress

        folder = tmp_path / name
        with monkeypatch.context() as patch:
            patch.setattr(Trainer, "improve", interrupted)
            options = [*tiny, "--iterations", 4, "--preview-every", 3]
            outcome = vnca("train", frame, style, "--out", folder, *options)
        codes = {None: 0, KeyboardInterrupt: 130, Terminated: 143}
        assert outcome.code == codes[interruption], outcome.err
        assert "Traceback" not in outcome.err
        if interruption is not None:
            assert f"to go on: vnca train --resume {folder}" in outcome.err
        return folder

    return run


def contents(run: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in run.iterdir() if not p.name.startswith("events.")}


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, Terminated])
def test_a_training_gone_on_with_ends_as_if_it_had_not_been_interrupted(
    vnca: Vnca, begin: Begin, interruption: type[BaseException]
) -> None:
    whole, run = begin("whole"), begin("run", interruption)
    assert Model.load(run).training["iterations"] == 2
    assert (run / CHECKPOINT_NAME).exists()
    assert vnca("train", "--resume", run).code == 0
    # The preview of where it was interrupted stays.
    assert contents(run) == contents(whole) | {
        "preview_000002.png": (run / "preview_000002.png").read_bytes()
    }
    finished = vnca("train", f"--resume={run}")
    assert finished.code == 0
    assert "come to its end" in finished.err
    assert (run / MODEL_NAME).read_bytes() == (whole / MODEL_NAME).read_bytes()


def test_the_curves_go_on_where_the_checkpoint_was(vnca: Vnca, begin: Begin) -> None:
    accumulating = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    whole, run = begin("whole"), begin("run", KeyboardInterrupt)
    vnca("train", "--resume", run)
    assert len(list(run.glob("events.*"))) == 2

    def curve(folder: Path) -> list[tuple[int, float]]:
        events = accumulating.EventAccumulator(str(folder)).Reload()
        assert events.Images("preview")
        return [(point.step, point.value) for point in events.Scalars("loss/total")]

    assert curve(run) == curve(whole)


def test_a_folder_can_be_moved_and_its_inputs_too(vnca: Vnca, begin: Begin, frame: Path) -> None:
    whole, run = begin("whole"), begin("run", KeyboardInterrupt)
    moved = frame.rename(frame.parent.parent / frame.name)
    run = run.rename(run.parent / "elsewhere")
    complaint = vnca("train", "--resume", run).complaint
    assert "no such file" in complaint
    assert frame.name in complaint
    assert vnca("train", "--resume", run, "--frame", moved).code == 0
    assert (run / MODEL_NAME).read_bytes() == (whole / MODEL_NAME).read_bytes()


def test_changed_inputs_are_refused(vnca: Vnca, begin: Begin, smoke: Path, style: Path) -> None:
    run = begin("run", KeyboardInterrupt)
    before = contents(run)
    complaint = vnca("train", "--resume", run, "--frame", smoke / "ball_0003.vdb").complaint
    assert "the frame changed since this training began" in complaint
    Image.linear_gradient("L").resize((40, 50)).convert("RGB").save(style)
    complaint = vnca("train", "--resume", run).complaint
    assert "the style picture changed" in complaint
    assert contents(run) == before


def test_a_folder_without_a_training_is_told(vnca: Vnca, tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        complaint = vnca("train", "--resume", folder).complaint
        assert f"{folder}: no training to go on with" in complaint


def test_an_interrupted_training_is_not_overwritten_by_mistake(
    vnca: Vnca, begin: Begin, frame: Path, style: Path, tiny: list[str]
) -> None:
    run = begin("run", KeyboardInterrupt)
    (run / MODEL_NAME).unlink()
    again = ["train", frame, style, "--out", run, *tiny]
    complaint = vnca(*again).complaint
    assert f"--resume {run}" in complaint
    assert "--overwrite" in complaint
    assert vnca(*again, "--overwrite").code == 0
    assert not (run / CHECKPOINT_NAME).exists()
    assert len(list(run.glob("events.*"))) == 1


def test_a_damaged_checkpoint_is_told(vnca: Vnca, begin: Begin, tmp_path: Path) -> None:
    run = begin("run", KeyboardInterrupt)
    path = run / CHECKPOINT_NAME
    whole, tensors = path.read_bytes(), load_file(path)
    length = int.from_bytes(whole[:8], "little")
    described = json.loads(json.loads(whole[8 : 8 + length])["__metadata__"]["vnca_checkpoint"])

    def complaint(**options: object) -> str:
        changed = {**described, "options": {**described["options"], **options}}
        save_file(tensors, path, {"vnca_checkpoint": json.dumps(changed)})
        return vnca("train", "--resume", run).complaint

    for options in (
        {"preview_every": 0},
        {"preview_every": "1"},
        {"device": None},
        {"frame": 3},
        {"colour": "blue"},
        {"smoke": []},
        {"config": {**described["options"]["config"], "milestones": 0.5}},
        {"config": {**described["options"]["config"], "backend": "abacus"}},
    ):
        assert CHECKPOINT_NAME in complaint(**options)
    path.write_bytes(whole[: len(whole) // 2])
    assert CHECKPOINT_NAME in vnca("train", "--resume", run).complaint
    path.write_bytes(b"")
    assert CHECKPOINT_NAME in vnca("train", "--resume", run).complaint
    shutil.copy(run / MODEL_NAME, path)
    assert "not a vnca checkpoint" in vnca("train", "--resume", run).complaint


def test_training_that_keeps_diverging_ends_with_a_line_and_a_model(
    vnca: Vnca,
    frame: Path,
    smoke: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compare = AppearanceLoss.__call__

    def poisoned(self: AppearanceLoss, picture: torch.Tensor, *rest: object) -> Appearance:
        appearance = compare(self, picture, *rest)  # type: ignore[arg-type]
        terms = {name: term * torch.nan for name, term in appearance.terms.items()}
        return Appearance(appearance.total * torch.nan, terms)

    monkeypatch.setattr(AppearanceLoss, "__call__", poisoned)
    run = tmp_path / "run"
    outcome = vnca("train", frame, style, "--out", run, *tiny, "--iterations", 20)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    *_, complaint = outcome.err.splitlines()
    assert complaint.startswith("vnca: training has diverged 4 times")
    assert "--learning-rate" in complaint
    assert outcome.err.count("at half the learning rate") == 4
    assert not (run / CHECKPOINT_NAME).exists()
    assert vnca("stylize", run, smoke, "--out", tmp_path / "painted", "--warmup", 1).code == 0


def test_out_of_memory_while_training_is_one_line_and_loses_nothing(
    vnca: Vnca, begin: Begin, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    whole, run = begin("whole"), tmp_path / "run"
    roll = Trainer._roll

    def too_much(self: Trainer, *arguments: Any) -> torch.Tensor:
        return torch.empty(2**50) if self.iteration == 2 else roll(self, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Trainer, "_roll", too_much)
        options = [*tiny, "--iterations", 4, "--preview-every", 3]
        outcome = vnca("train", frame, style, "--out", run, *options)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    *_, complaint = outcome.err.splitlines()
    assert complaint.startswith("vnca: out of memory in iteration 3: for 1328 cells")
    assert re.search(r"--view\.size 32 about \d+ MB", complaint)
    assert f"with a --memory-budget: vnca train --resume {run}" in complaint
    assert Model.load(run).training["iterations"] == 2
    assert vnca("train", "--resume", run).code == 0
    assert contents(run) == contents(whole)


def test_a_training_goes_on_with_another_memory_budget(vnca: Vnca, begin: Begin) -> None:
    whole, run = begin("whole"), begin("run", KeyboardInterrupt)
    resume = ("train", "--resume", run, "--memory-budget")
    assert "--memory-budget 1 MB: at least" in vnca(*resume, "1MB").complaint
    assert vnca(*resume, "100GB").code == 0
    assert (run / MODEL_NAME).read_bytes() == (whole / MODEL_NAME).read_bytes()


def test_out_of_memory_before_training_is_one_line(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    options = [*tiny, "--view.size", 300_000]
    complaint = vnca("train", frame, style, "--out", tmp_path / "run", *options).complaint
    assert "out of memory" in complaint
    assert "--view.size 300000" in complaint
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("when", ["in the texture", "between", "in the smoke"])
def test_a_training_that_begins_with_a_texture_goes_on_from_anywhere(
    vnca: Vnca,
    frame: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    when: str,
) -> None:
    options = [*tiny, "--texture", 1.5]  # three iterations, then two on smoke
    whole, run = tmp_path / "whole", tmp_path / "run"
    assert vnca("train", frame, style, "--out", whole, *options).code == 0
    assert Model.load(whole / "texture").training["iterations"] == 3
    assert Model.load(whole).training["iterations"] == 2
    improve, left = Trainer.improve, {"in the texture": 2, "between": 3, "in the smoke": 4}[when]
    done = 0

    def interrupted(self: Trainer) -> Progress:
        nonlocal done
        if done == left:
            raise KeyboardInterrupt
        done += 1
        return improve(self)

    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "improve", interrupted)
        stopped = vnca("train", frame, style, "--out", run, *options)
    assert stopped.code == 130
    assert f"vnca train --resume {run}" in stopped.err
    assert vnca("train", "--resume", run).code == 0
    assert (run / MODEL_NAME).read_bytes() == (whole / MODEL_NAME).read_bytes()
    assert not (run / CHECKPOINT_NAME).exists()


def test_a_texture_that_is_to_be_overwritten_is_not_taken_for_the_new_one(
    vnca: Vnca,
    frame: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole, run = tmp_path / "whole", tmp_path / "run"
    options = [*tiny, "--texture", 1, "--seed", 5]
    assert vnca("train", frame, style, "--out", whole, *options).code == 0
    assert vnca("train", frame, style, "--out", run, *tiny, "--texture", 1).code == 0

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("vnca.recipe.texture.run", stop)
        vnca("train", frame, style, "--out", run, *options, "--overwrite")
    assert vnca("train", "--resume", run).code == 0
    assert (run / MODEL_NAME).read_bytes() == (whole / MODEL_NAME).read_bytes()


def test_inputs_that_change_while_the_texture_is_trained_are_refused(
    vnca: Vnca,
    frame: Path,
    smoke: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stop(self: Trainer) -> Progress:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "improve", stop)
        vnca("train", frame, style, "--out", tmp_path / "run", *tiny, "--texture", 1)
    another = smoke / "ball_0003.vdb"
    complaint = vnca("train", "--resume", tmp_path / "run", "--frame", another).complaint
    assert "the frame changed since this training began" in complaint


def test_what_begins_with_a_texture_differs_from_what_does_not(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    for name, texture in (("with", 1), ("without", 0)):
        options = [*tiny, "--texture", texture]
        assert vnca("train", frame, style, "--out", tmp_path / name, *options).code == 0
    one, two = (Model.load(tmp_path / name).rule for name in ("with", "without"))
    assert not (one.output == two.output).all()
    assert not (tmp_path / "without" / "texture").exists()


def test_a_texture_that_is_trained_already_is_what_training_begins_with(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    both, given = tmp_path / "both", tmp_path / "given"
    options = ("train", frame, style, *tiny[: tiny.index("--texture")])
    assert vnca(*options, "--out", both, "--texture", 1).code == 0
    assert vnca(*options, "--out", given, "--init", both / "texture").code == 0
    assert not (given / "texture").exists()
    assert (given / MODEL_NAME).read_bytes() == (both / MODEL_NAME).read_bytes()


def test_a_model_of_smoke_goes_on_with_what_it_has_learnt_of_smoke(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    first, then = tmp_path / "first", tmp_path / "then"
    assert vnca("train", frame, style, "--out", first, *tiny, "--texture", 0).code == 0
    on = (*tiny[: tiny.index("--texture")], "--iterations", 1, "--init", first)
    assert vnca("train", frame, style, "--out", then, *on).code == 0
    before, after = (Model.load(run).rule for run in (first, then))
    told = before.config.inputs - before.config.conditioning_width
    learnt = before.hidden[:, told:]
    assert (learnt != 0).any()
    # One iteration moves a weight by no more than the rate.
    assert abs(after.hidden[:, told:] - learnt).max() < abs(learnt).max() / 4


def test_a_texture_that_cannot_be_begun_with_is_refused(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    options = ("train", frame, style, *tiny[: tiny.index("--texture")])
    assert vnca(*options, "--out", run, "--texture", 0).code == 0
    other = (*options, "--out", tmp_path / "other", "--init", run)
    complaint = vnca(*other, "--hidden", 9).complaint
    assert f"--init {run}" in complaint
    assert "in place of 9" in complaint
    assert "one of them" in vnca(*other, "--texture", 1).complaint
    complaint = vnca(*options, "--out", tmp_path / "other", "--init", "iink").complaint
    assert "--init iink: no such file, nor a style of the library (cafe, church" in complaint
    assert not (tmp_path / "other").exists()


def test_a_share_of_texture_below_zero_is_refused(vnca: Vnca, frame: Path, style: Path) -> None:
    assert "--texture -1" in vnca("train", frame, style, "--out", "x", "--texture", -1).complaint
