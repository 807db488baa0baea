from pathlib import Path

import pytest
import torch
import train as loop
from pairs import Pairs, random_pairs
from textures import bank, spectral
from torch import Generator, Tensor
from train import FlowTraining, flow_loss, train

from vnca.core.errors import BackendUnavailableError, OutputError
from vnca.features.flow import FlowNetwork


def pairs() -> Pairs:
    random = Generator().manual_seed(0)
    return random_pairs(bank({spectral: 1}, 4, 64, random), 4, 48, random)


def test_the_truth_has_no_error_and_the_opposite_the_most() -> None:
    example = pairs()
    losses = [float(flow_loss([s * example.flow], example)) for s in (1.0, 0.5, 0.0, -1.0)]
    assert losses[0] < 0.05
    assert losses == sorted(losses)


def test_what_is_seen_counts_more_than_the_background() -> None:
    example = pairs()
    example = Pairs(example.before, example.after, example.flow, torch.zeros_like(example.seen))
    example.seen[:, :, :24] = 1
    wrong_left, wrong_right = example.flow.clone(), example.flow.clone()
    wrong_left[..., :24] += 1
    wrong_right[..., 24:] += 1
    assert flow_loss([wrong_left], example) > 5 * flow_loss([wrong_right], example)


@pytest.fixture
def few_textures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "KINDS", {spectral: 1})
    monkeypatch.setattr(loop, "TEXTURES", 8)
    monkeypatch.setattr(loop, "TEXTURE_SIDE", 96)
    monkeypatch.setattr(loop, "SIDES", (48,))


@pytest.mark.usefixtures("few_textures")
def test_a_seed_gives_the_same_weights_again(tmp_path: Path) -> None:
    def weights(seed: int) -> Tensor:
        out = tmp_path / "flow.safetensors"
        train(FlowTraining(out, seed, iterations=3, pixels=48**2, every=2), lambda _: None)
        return FlowNetwork.read(out).first.weight.detach()

    first = weights(0)
    assert torch.equal(first, weights(0))
    assert not torch.equal(first, weights(1))


@pytest.mark.usefixtures("few_textures")
def test_progress_is_told(tmp_path: Path) -> None:
    told: list[str] = []
    options = FlowTraining(tmp_path / "flow.safetensors", iterations=3, pixels=48**2, every=2)
    train(options, told.append)
    assert len(told) == 2
    assert "2 of 3" in told[0]
    assert "endpoint error" in told[0]


def test_what_would_come_too_late_is_said_before_training(tmp_path: Path, monkeypatch) -> None:
    with pytest.raises(OutputError, match="name a file"):
        train(FlowTraining(tmp_path))
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(BackendUnavailableError, match="use `device` cpu"):
        train(FlowTraining(tmp_path / "flow.safetensors", device="cuda"))
