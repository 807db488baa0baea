"""What a page is told of a training."""

import json
from pathlib import Path

import numpy as np
import pytest

from vnca.rule.model import MODEL_NAME, Model
from vnca.training.run import Curves
from vnca.viewer import training_run
from vnca.viewer.training_run import progress, untaught


def test_curves_and_iterations_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training_run, "MOST_POINTS", 4)
    curves = Curves(tmp_path)
    for iteration in range(1, 12):
        curves.add(iteration, {"loss/total": 10.0 / iteration, "learning_rate": 1e-3})
    curves.add(12, {"loss/total": float("nan"), "loss/late": 2.0})
    curves.close()
    (tmp_path / "config.json").write_text(json.dumps({"config": {"iterations": 80}}))
    told = json.loads(progress(tmp_path))
    assert (told["iteration"], told["iterations"], told["model"]) == (12, 80, "0")
    assert set(told["curves"]) == {"total", "late"}
    total = told["curves"]["total"]
    assert total[-1] == [11, pytest.approx(10 / 11)]
    assert 2 <= len(total) <= 4


def test_a_record_that_is_being_written_is_left_out(tmp_path: Path) -> None:
    curves = Curves(tmp_path)
    for iteration in (1, 2):
        curves.add(iteration, {"loss/total": 1.0})
    curves.close()
    (path,) = tmp_path.glob("events*")
    path.write_bytes(path.read_bytes()[:-3])
    assert json.loads(progress(tmp_path))["iteration"] == 1


def test_points_written_again_count_once(tmp_path: Path) -> None:
    for value in (3.0, 2.0):
        curves = Curves(tmp_path)
        curves.add(5, {"loss/total": value})
        curves.close()
    assert json.loads(progress(tmp_path))["curves"]["total"] == [[5, 2.0]]


def test_an_empty_folder_tells_of_nothing(tmp_path: Path) -> None:
    told = json.loads(progress(tmp_path))
    assert told == {"model": "0", "iteration": 0, "iterations": 0, "curves": {}}


def test_a_model_that_is_written_anew_is_another(tmp_path: Path) -> None:
    content = untaught(np.full((4, 4, 4), 0.5, np.float32), tmp_path / "blank")
    assert not (tmp_path / "blank").exists()
    (tmp_path / MODEL_NAME).write_bytes(content)
    first = json.loads(progress(tmp_path))["model"]
    model = Model.load(tmp_path)
    assert not model.rule.output.any()
    assert model.rule.scales.density == pytest.approx(0.5)
    model.save(tmp_path / MODEL_NAME)
    assert json.loads(progress(tmp_path))["model"] != first
