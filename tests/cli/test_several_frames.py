"""A rule that is trained on several frames by turns, as a user trains it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vnca as api
from vnca.core.errors import GridError, OptionError
from vnca.io import read_smoke, write_smoke
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME
from vnca.training.loop import Progress, Trainer

Vnca = Callable[..., Any]


@pytest.fixture(autouse=True)
def small_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of the time, and nothing here is about how they look."""
    monkeypatch.setattr("vnca.training.run.PREVIEW_SIZE", 32)


@pytest.fixture
def asked(smoke: Path, style: Path, tiny: list[str]) -> list[object]:
    """A training of five iterations on three frames."""
    frames = [smoke / f"ball_000{number}.vdb" for number in (1, 2, 3)]
    return [frames[0], style, *tiny, "--iterations", 5, "--more-frames", *frames[1:]]


def test_it_tells_what_it_was_trained_on(vnca: Vnca, asked: list[object], tmp_path: Path) -> None:
    outcome = vnca("train", *asked, "--out", tmp_path / "run")
    assert outcome.code == 0, outcome.err
    cells = outcome.err.split(" cells, ")[0].splitlines()[-1].split(" + ")
    assert len(cells) == 3
    assert all(int(count) > 0 for count in cells)
    model = Model.load(tmp_path / "run")
    assert model.training["frame"] == "ball_0001.vdb, ball_0002.vdb, ball_0003.vdb"
    told = json.loads((tmp_path / "run" / "config.json").read_text())["inputs"]
    assert [Path(path).name for path in told["more_frames"]] == ["ball_0002.vdb", "ball_0003.vdb"]
    small = ("--size", "64", "--style-scale", "1", "--warmup", "3", "--steps-per-frame", "2")
    assert vnca("evaluate", tmp_path / "run", *small).code == 0  # finds the frame and the picture


def test_one_that_was_interrupted_ends_as_if_it_had_not(
    vnca: Vnca,
    asked: list[object],
    smoke: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With a velocity scale that is fitted to the first frame, and would not fit the last."""
    whole, run, improve = tmp_path / "whole", tmp_path / "run", Trainer.improve
    volume = read_smoke(smoke / "ball_0001.vdb")
    x, y, z = volume.origin
    faster = [tmp_path / f"faster_000{number}.vdb" for number in (1, 2)]
    for number, path in enumerate(faster):
        write_smoke(path, replace(volume, origin=(x, y, z + 2 * number), frame=number))
    last = faster[0]
    asked = [*asked[:-3], "--velocity-scale", "fit", *asked[-3:-1], last]
    assert vnca("train", *asked, "--out", whole).code == 0

    def interrupted(self: Trainer) -> Progress:
        if self.iteration == 4:  # Each of the frames has a state by then.
            raise KeyboardInterrupt
        return improve(self)

    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "improve", interrupted)
        assert vnca("train", *asked, "--out", run).code == 130
    kept = last.read_bytes()
    last.write_bytes((smoke / "ball_0003.vdb").read_bytes())
    complaint = vnca("train", "--resume", run).complaint
    assert "the further frames changed since this training began" in complaint
    assert (run / CHECKPOINT_NAME).exists()
    last.write_bytes(kept)
    assert vnca("train", "--resume", run).code == 0
    assert (run / MODEL_NAME).read_bytes() == (whole / MODEL_NAME).read_bytes()


def test_frames_that_do_not_go_together_are_refused(
    vnca: Vnca, asked: list[object], smoke: Path, style: Path, tmp_path: Path
) -> None:
    volume = read_smoke(smoke / "ball_0003.vdb")
    dense, still = tmp_path / "dense_1.vdb", tmp_path / "still_1.vdb"
    write_smoke(dense, replace(volume, density=200 * volume.density))
    write_smoke(still, replace(volume, velocity=None))
    for path, line in (
        (dense, f"{dense}: has 200 times the density of {smoke}"),
        (still, f"{still}: has no velocity, as another of the frames has"),
        (tmp_path / "absent.vdb", "absent.vdb: no such file"),
    ):
        outcome = vnca("train", *asked[:-1], path, "--out", tmp_path / "run")
        assert outcome.code == 2
        assert line in outcome.complaint
        assert not (tmp_path / "run" / MODEL_NAME).exists()
    with pytest.raises(GridError, match="in-memory: there is no smoke in this frame"):
        api.train([volume, replace(volume, density=0 * volume.density)], style)


def test_python_takes_a_list_of_files_or_of_volumes(smoke: Path, style: Path) -> None:
    paths = [smoke / f"ball_000{number}.vdb" for number in (1, 2)]
    small: dict[str, Any] = {
        "iterations": 2,
        "texture": 0,
        "view": {"size": 32},
        "rule": {"hidden": 8, "channels": 6},
        "shortest_rollout": 2,
        "longest_rollout": 3,
        "appearance": {"samples": 64, "layers": ("stem", "block1"), "style_scale": 1.0},
        "device": "cpu",
    }
    by_files = api.train(paths, style, **small)
    by_volumes = api.train([read_smoke(path) for path in paths], style, **small)
    alone = api.train(paths[0], style, **small)
    np.testing.assert_array_equal(by_files.rule.output, by_volumes.rule.output)
    assert (by_files.rule.output != alone.rule.output).any()
    with pytest.raises(OptionError, match="`frame`: expected files or volumes, not both"):
        api.train([paths[0], read_smoke(paths[1])], style, **small)  # type: ignore[list-item]
    with pytest.raises(OptionError, match="`frame`: expected"):
        api.train([], style, **small)
