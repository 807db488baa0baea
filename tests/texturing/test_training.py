from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.features import load_network
from vnca.features.vgg import VGG16
from vnca.losses.appearance import AppearanceConfig
from vnca.rule import DENSITY_CHANGE
from vnca.training.config import PoolConfig, TextureConfig
from vnca.training.ground import Ground
from vnca.training.loop import Trainer
from vnca.training.run import preview_sheet
from vnca.training.scenes import Scene
from vnca.training.trainers import texture_trainer

Make = Callable[..., Trainer]


@pytest.fixture
def trainer(style: FloatArray, tiny_config: TextureConfig, vgg: VGG16) -> Make:
    """Makes a trainer of the tiny training with some options changed."""

    def make(**options: object) -> Trainer:
        config = replace(tiny_config, **options)  # type: ignore[arg-type]
        return texture_trainer(style, config, vgg)

    return make


def weights(trainer: Trainer) -> list[FloatArray]:
    rule = trainer.rule()
    assert rule.decoder is not None
    return [rule.hidden, rule.bias, rule.output, *rule.decoder.weights]


def same(a: Trainer, b: Trainer) -> bool:
    return all(map(np.array_equal, weights(a), weights(b)))


def test_training_brings_slices_nearer_to_the_style(trainer: Make) -> None:
    learning = trainer(
        iterations=50, shortest_rollout=6, longest_rollout=6, learning_rate=6e-3, rate_warmup=10
    )
    losses = [step.loss for step in learning.run()]
    # At such a rate losses leap, differently on each machine.
    assert min(losses[-10:]) < 0.85 * losses[0]


@pytest.mark.parametrize("source", ["efficientnet", "edges"])
def test_any_network_teaches(style: FloatArray, tiny_config: TextureConfig, source: str) -> None:
    """With the layers and the scale that it and the picture choose."""
    config = replace(tiny_config, appearance=AppearanceConfig(samples=128))
    learning = texture_trainer(style, config, load_network(source))
    before = weights(learning)
    assert all(np.isfinite(step.loss) for step in learning.run())
    assert not np.array_equal(before[2], weights(learning)[2])
    assert learning.picture_cells == [learning.appearances[0].style_scale * config.slice.cells]


def test_same_seed_same_weights_and_another_seed_others(trainer: Make) -> None:
    one, two, other = trainer(seed=7), trainer(seed=7), trainer(seed=8)
    for training in (one, two, other):
        list(training.run())
    assert same(one, two)
    assert not same(one, other)


def test_looking_at_previews_changes_nothing(trainer: Make, style: FloatArray) -> None:
    looked, unseen = trainer(), trainer()
    for _ in looked.run():
        assert preview_sheet(looked, style).ndim == 3
    list(unseen.run())
    assert same(looked, unseen)


def test_smoke_painted_with_a_texture_keeps_its_density(trainer: Make) -> None:
    training = trainer(iterations=4)
    list(training.run())
    rule = training.rule()
    assert not rule.output[DENSITY_CHANGE].any()
    assert rule.output[[0, 1, 2, 4, 5]].any(1).all()
    state = training.grow(3)
    assert not state[:, DENSITY_CHANGE].any()
    assert rule.decoder is not None
    assert rule.decoder.weights.output[:DENSITY_CHANGE].any()
    assert not rule.decoder.weights.output[DENSITY_CHANGE].any()
    assert not rule.decoder.weights.output_bias[DENSITY_CHANGE].any()


def test_a_decoder_learns_with_the_rule_and_can_be_left_out(trainer: Make) -> None:
    training = trainer(iterations=2)
    before = weights(training)
    list(training.run())
    assert not any(map(np.array_equal, before[3:], weights(training)[3:]))
    plain = trainer(iterations=2, decoder=0)
    list(plain.run())
    assert plain.rule().decoder is None


def test_cells_that_know_nothing_begin_to_learn_at_once(trainer: Make) -> None:
    training = trainer(iterations=1)
    list(training.run())
    assert training.rule().output.any()


def test_terms_are_told_and_add_up(trainer: Make) -> None:
    step = trainer().improve()
    assert set(step.terms) == {"style", "moments", "pixels", "overflow"}
    assert sum(step.terms.values()) == pytest.approx(step.loss, rel=1e-5)


def test_exploded_states_are_told_and_do_not_stay(trainer: Make) -> None:
    training = trainer(
        iterations=8, learning_rate=50.0, pool=PoolConfig(size=2, reseed_every=10**9, limit=2.0)
    )
    steps = list(training.run())
    assert any(step.exploded for step in steps)
    assert all(state.abs().max() <= 2 for state in training._grounds[0].pool._states.values())
    assert all(np.isfinite(w).all() for w in weights(training))


def test_states_live_on_from_iteration_to_iteration(trainer: Make) -> None:
    training = trainer(iterations=3, pool=PoolConfig(size=1, reseed_every=10**9))
    starts: list[bool] = []
    roll = training._roll

    def look(ground: Ground, state: torch.Tensor, steps: range, scene: Scene[Any]) -> torch.Tensor:
        starts.append(bool(state.any()))
        return roll(ground, state, steps, scene)

    training._roll = look  # type: ignore[method-assign,assignment]
    list(training.run())
    assert starts == [False, False, True]


def test_the_native_kernel_and_the_reference_learn_alike(trainer: Make) -> None:
    native, reference = (trainer(iterations=2, backend=name) for name in ("native", "reference"))
    for training in (native, reference):
        list(training.run())
    for ours, theirs in zip(weights(native), weights(reference), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=2e-4)
