import json
from pathlib import Path

import numpy as np
import pytest

from vnca.core.errors import OutputError
from vnca.rule import Rule, RuleConfig, Scales
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.config import SmokeConfig
from vnca.training.loop import Progress
from vnca.training.run import RunFolder

MODEL = Model(Rule.initial(RuleConfig(channels=4, hidden=2), Scales(), seed=0))


def test_choosing_a_folder_leaves_no_trace(tmp_path: Path) -> None:
    RunFolder(tmp_path / "a" / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_run_folder_holds_configuration_model_preview_and_curves(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "run") as folder:
        folder.start(SmokeConfig(seed=3), {"style": "night.png"})
        folder.log(Progress(1, 5.0, {"style": 4.0, "overflow": 1.0}, exploded=False), 1e-3)
        folder.preview(np.full((4, 6, 3), 0.5, np.float32), 1)
        folder.save(MODEL)
    names = {path.name for path in folder.path.iterdir()}
    assert {"config.json", MODEL_NAME, "preview_000001.png"} < names
    assert any(name.startswith("events.out.tfevents.") for name in names)
    resolved = json.loads((folder.path / "config.json").read_text())
    assert resolved["style"] == "night.png"
    assert resolved["config"]["seed"] == 3
    assert resolved["config"]["view"]["size"] == SmokeConfig().view.size
    assert Model.load(folder.path).rule.config == MODEL.rule.config


def test_loss_curves_can_be_read_again(tmp_path: Path) -> None:
    loading = pytest.importorskip("tensorboard.backend.event_processing.event_file_loader")
    with RunFolder(tmp_path) as folder:
        folder.log(Progress(1, 5.0, {"style": 4.0}, exploded=True), 1e-3)
        folder.log(Progress(2, 2.5, {"style": 2.0}, exploded=False), 1e-3)
    (events,) = tmp_path.glob("events.out.tfevents.*")
    points = {
        (value.tag, event.step): value.tensor.float_val[0]
        for event in loading.EventFileLoader(str(events)).Load()
        for value in event.summary.value
    }
    assert points["loss/total", 2] == 2.5
    assert points["loss/style", 1] == 4.0
    assert points["state/exploded", 1] == 1.0
    assert points["learning_rate", 2] == pytest.approx(1e-3)


def test_an_earlier_model_is_kept_unless_it_may_be_overwritten(tmp_path: Path) -> None:
    MODEL.save(tmp_path / MODEL_NAME)
    with pytest.raises(OutputError, match="`overwrite`"):
        RunFolder(tmp_path)
    (tmp_path / "preview_000300.png").write_bytes(b"old")
    (tmp_path / "events.out.tfevents.1").write_bytes(b"old")
    (tmp_path / "preview_of_mine.png").write_bytes(b"mine")
    with RunFolder(tmp_path, overwrite=True) as folder:
        folder.preview(np.zeros((2, 2, 3), np.float32), 1)
    assert {path.name for path in tmp_path.glob("preview*")} == {
        "preview_000001.png",
        "preview_of_mine.png",
    }
    assert len(list(tmp_path.glob("events*"))) == 1
    assert (tmp_path / MODEL_NAME).exists()


def test_a_file_where_the_folder_should_be_is_told(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("mine")
    for path in (tmp_path / "run", tmp_path / "run" / "deeper"):
        with pytest.raises(OutputError, match="not a folder"):
            RunFolder(path)
    assert (tmp_path / "run").read_text() == "mine"
