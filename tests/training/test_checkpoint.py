import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from vnca.core import FloatArray
from vnca.core.errors import FileFormatError, OptionError
from vnca.core.volume import Volume
from vnca.features.flow import FlowNetwork
from vnca.features.vgg import VGG16
from vnca.losses import MotionConfig
from vnca.training.checkpoint import Checkpoint, Thrift, fingerprints
from vnca.training.config import SmokeConfig
from vnca.training.loop import Trainer
from vnca.training.scenes.smoke import SmokeScene
from vnca.training.trainers import smoke_trainer

Make = Callable[..., Trainer]
Change = Callable[[dict[str, torch.Tensor], dict[str, Any]], object]
INPUTS = {"frame": "a", "options": "b"}


@pytest.fixture
def trainer(tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16) -> Make:
    """Makes a trainer of the tiny training with some options changed."""

    def make(**options: Any) -> Trainer:
        return smoke_trainer(tiny_smoke, style, replace(tiny_config, iterations=6, **options), vgg)

    return make


def weights(training: Trainer) -> list[FloatArray]:
    rule = training.rule()
    return [rule.hidden, rule.bias, rule.output]


def same(a: Trainer, b: Trainer) -> bool:
    return all(map(np.array_equal, weights(a), weights(b)))


def through_a_file(training: Trainer, path: Path) -> Checkpoint:
    Checkpoint(training.snapshot(), INPUTS, "train", {"out": "run"}).save(path)
    return Checkpoint.load(path)


@pytest.mark.parametrize("options", [{}, {"motion": MotionConfig(weight=1.0)}])
def test_a_training_that_was_read_back_ends_as_one_that_was_not(
    trainer: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any]
) -> None:
    torch.manual_seed(0)
    network = FlowNetwork()
    monkeypatch.setattr(FlowNetwork, "load", lambda device: network)
    path = tmp_path / "checkpoint.safetensors"
    whole = trainer(**options)
    losses = [step.loss for step in whole.run()]
    relay, again = trainer(**options), []
    for stop in (0, 1, 4, 6):
        while relay.iteration < stop:
            again.append(relay.improve().loss)
        checkpoint, relay = through_a_file(relay, path), trainer(**options)
        checkpoint.resume(relay, INPUTS, path)
    assert again == losses
    assert same(relay, whole)


def test_a_snapshot_is_not_changed_by_training_on(trainer: Make) -> None:
    training = trainer()
    for _ in range(3):
        training.improve()
    left = training.snapshot()
    one = [step.loss for step in training.run()]
    training.restore(left)
    assert [step.loss for step in training.run()] == one


@pytest.mark.parametrize(
    ("kind", "where"),
    [(Trainer, "_roll"), (SmokeScene, "pictures"), (Trainer, "_improve")],
)
def test_an_interrupted_iteration_leaves_no_trace(
    trainer: Make, monkeypatch: pytest.MonkeyPatch, kind: type, where: str
) -> None:
    training, whole = trainer(), trainer()
    losses = [step.loss for step in whole.run()]
    begun = [training.improve().loss for _ in range(2)]
    with monkeypatch.context() as patch:
        work = getattr(kind, where)

        def interrupted(*arguments: Any) -> None:
            work(*arguments)
            raise KeyboardInterrupt

        patch.setattr(kind, where, interrupted)
        with pytest.raises(KeyboardInterrupt):
            training.improve()
    left = training.snapshot()
    training.undo()
    assert training.iteration == 2
    assert begun + [step.loss for step in training.run()] == losses
    resumed = trainer()
    resumed.restore(left)
    list(resumed.run())
    assert same(resumed, whole)
    assert same(training, whole)


def test_what_changed_since_is_told(trainer: Make, tmp_path: Path) -> None:
    training = trainer()
    path = tmp_path / "checkpoint.safetensors"
    checkpoint = through_a_file(training, path)
    with pytest.raises(OptionError, match="the frame and the options changed since"):
        checkpoint.resume(training, {"frame": "x", "options": "y"}, path)


def test_every_input_has_a_fingerprint_of_its_own(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    frame = [tiny_smoke.density, tiny_smoke.origin, tiny_smoke.velocity]
    own = fingerprints(style, tiny_config, vgg, frame=frame)
    density, origin, velocity = frame
    fainter = density.copy()
    fainter[5, 5, 5] += 1e-6
    others = {
        "frame": [
            (style, tiny_config, [fainter, origin, velocity]),
            (style, tiny_config, [density, origin, velocity * 1.01]),
            (style, tiny_config, [density, origin]),
            (style, tiny_config, [density, (0, 0, 0), velocity]),
        ],
        "style picture": [(style[::-1], tiny_config, frame)],
        "options": [(style, replace(tiny_config, seed=1), frame)],
    }
    for name, changes in others.items():
        for picture, config, arrays in changes:
            changed = fingerprints(picture, config, vgg, frame=arrays)
            assert {n for n in own if own[n] != changed[n]} == {name}
    elsewhere = replace(tiny_config, features="/other/path.pth")
    assert fingerprints(style, elsewhere, vgg, frame=frame) == own


@pytest.fixture(scope="module")
def written(
    tiny_smoke: Volume,
    style: FloatArray,
    tiny_config: SmokeConfig,
    vgg: VGG16,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    training = smoke_trainer(tiny_smoke, style, tiny_config, vgg)
    training.improve()
    path = tmp_path_factory.mktemp("written") / "checkpoint.safetensors"
    through_a_file(training, path)
    return path


@pytest.fixture
def damaged(written: Path, tmp_path: Path) -> Callable[[Change], Path]:
    """Writes a checkpoint with its tensors and its description changed."""

    def damage(change: Change) -> Path:
        tensors = load_file(written)
        header = written.read_bytes()
        length = int.from_bytes(header[:8], "little")
        metadata = json.loads(header[8 : 8 + length])["__metadata__"]
        described = json.loads(metadata["vnca_checkpoint"])
        change(tensors, described)
        path = tmp_path / "damaged.safetensors"
        save_file(tensors, path, {"vnca_checkpoint": json.dumps(described)})
        return path

    return damage


WEIGHT, STATE = "descent.now.0.weight", "pool.0"


@pytest.mark.parametrize(
    "change",
    [
        lambda t, d: d.pop("format_version"),
        lambda t, d: d.update(format_version=2),
        lambda t, d: d.update(format_version="1"),
        lambda t, d: d.update(values=[]),
        lambda t, d: d.update(values={"trainer": 3}),
        lambda t, d: d.update(inputs=None),
        lambda t, d: d.pop("command"),
        lambda t, d: d["values"].pop("trainer"),
        lambda t, d: d["values"].pop("pool"),
        lambda t, d: d["values"]["trainer"].update(iteration=7),
        lambda t, d: d["values"]["trainer"].update(iteration=-1),
        lambda t, d: d["values"]["trainer"].update(iteration=1.0),
        lambda t, d: d["values"]["trainer"].update(iteration=True),
        lambda t, d: d["values"]["trainer"].update(steps=2**60),
        lambda t, d: d["values"]["trainer"].update(random={"bit_generator": "MT19937"}),
        lambda t, d: d["values"]["trainer"]["random"].update(state={"state": -1, "inc": 1}),
        lambda t, d: d["values"]["trainer"]["random"].update(state={"state": "", "inc": 1}),
        lambda t, d: d["values"]["descent"].update(rollbacks=5),
        lambda t, d: d["values"]["descent"].update(kept_at=None),
        lambda t, d: t.pop(WEIGHT),
        lambda t, d: t.update({WEIGHT: t[WEIGHT][:-1]}),
        lambda t, d: t.update({WEIGHT: t[WEIGHT].double()}),
        lambda t, d: t.update({WEIGHT: t[WEIGHT] + torch.nan}),
        lambda t, d: t.update({"descent.kept.0.exp_avg_sq": t["descent.kept.0.exp_avg_sq"] - 1}),
        lambda t, d: t.update({"descent.now.0.step": torch.tensor(-5.0)}),
        lambda t, d: t.update({"trainer.generator": t["trainer.generator"][1:]}),
        lambda t, d: t.update({"trainer.generator": 0 * t["trainer.generator"]}),
        lambda t, d: t.update({"pool.64": torch.zeros(1)}),
        lambda t, d: t.update({"pool.0": torch.zeros(1)}),
        lambda t, d: t.update({"pool.one": torch.zeros(1)}),
        lambda t, d: t.update({n: 100 + s for n, s in t.items() if n.startswith("pool.")}),
    ],
)
def test_a_damaged_checkpoint_is_refused_by_its_name(
    trainer: Make, damaged: Callable[[Change], Path], change: Change, tiny_config: SmokeConfig
) -> None:
    path = damaged(change)
    with pytest.raises(FileFormatError, match=r"damaged\.safetensors"):
        Checkpoint.load(path).resume(trainer(), INPUTS, path)


@pytest.mark.parametrize("keep", [0, 1, 7, 8, 100, -1])
def test_a_truncated_checkpoint_is_refused(written: Path, tmp_path: Path, keep: int) -> None:
    path = tmp_path / "short.safetensors"
    path.write_bytes(written.read_bytes()[:keep])
    with pytest.raises(FileFormatError, match=r"short\.safetensors"):
        Checkpoint.load(path)


def test_a_checkpoint_is_written_under_no_name_but_ours(
    written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or a program that is killed meanwhile would leave a file that nobody removes."""
    made: list[int] = []

    def make(*args: Any, **options: Any) -> tuple[int, str]:
        handle, name = mkstemp(*args, **options)
        made.append(os.stat(handle).st_ino)
        return handle, name

    checkpoint, mkstemp = Checkpoint.load(written), tempfile.mkstemp
    monkeypatch.setattr(tempfile, "mkstemp", make)
    checkpoint.save(tmp_path / "again.safetensors")
    assert made == [(tmp_path / "again.safetensors").stat().st_ino]


def test_checkpoints_take_their_share_of_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    thrift = Thrift()
    assert not thrift.is_due
    spent, start = 0.0, now
    for cost in (0.1, 2.0, 0.5, 3.0):
        while not thrift.is_due:
            now += 0.7
        with thrift.writing():
            now += cost
        spent += cost
    while not thrift.is_due:
        now += 0.7
    assert spent / (now - start) <= Thrift.share
    with thrift.writing():
        now += 0.0
    now += 29
    assert not thrift.is_due
    now += 2
    assert thrift.is_due
