from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import torch

from vnca.bench import train
from vnca.bench.train import Training, measure_training
from vnca.core.errors import DisagreementError
from vnca.core.volume import Volume
from vnca.engine.reference import equations as reference
from vnca.features.vgg import VGG16
from vnca.io.picture import read_image, resize
from vnca.losses.appearance import AppearanceConfig
from vnca.training.config import SmokeConfig, ViewConfig
from vnca.training.presets import preset


@pytest.fixture
def training(tiny_smoke: Volume) -> Training:
    """A training of little moment."""
    draft = preset(SmokeConfig, "draft")
    config = replace(
        draft,
        rule=replace(draft.rule, channels=6, hidden=8),
        appearance=AppearanceConfig(layers=("relu1_1", "relu2_1"), samples=64),
        view=ViewConfig(size=32),
        shortest_rollout=2,
        longest_rollout=2,
    )
    style = resize(read_image(Path(str(files("vnca.data") / "vangogh_cafe_terrace.webp"))), 40, 50)
    return Training(tiny_smoke, style, config, VGG16.load(), torch.device("cpu"))


def test_the_plain_step_trains_as_the_others_do(training: Training) -> None:
    rows = measure_training(training, ("plain", "reference"), repeats=2)
    assert [row["backend"] for row in rows] == ["plain", "reference"]
    for row in rows:
        assert (row["hidden"], row["rollout"], row["view"]) == (8, 2, 32)
        assert row["cells"] > 500
        assert 0 < row["seconds_min"] <= row["seconds"] <= row["seconds_max"]


def test_rollouts_begin_from_a_grown_state(training: Training) -> None:
    trainer = training.trainer("reference")
    terms = [trainer.improve().terms for _ in range(train.WARMUP + 10)]
    assert all("steadiness" in found for found in terms[train.WARMUP :])  # only what has grown can


def test_nothing_is_timed_when_a_backend_learns_something_else(
    training: Training, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Careless:
        def __init__(self, *arguments: Any, **options: Any) -> None:
            pass

        def __call__(self, state: torch.Tensor, *rest: Any) -> torch.Tensor:
            return reference.update(state, *rest) + 0.1

    def never(*arguments: Any) -> None:
        pytest.fail("timed")

    monkeypatch.setattr(train, "PlainUpdate", Careless)
    monkeypatch.setattr(train, "_seconds", never)
    with pytest.raises(DisagreementError, match="plain: loss"):
        measure_training(training, ("reference", "plain"), repeats=1)
