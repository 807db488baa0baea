from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.losses import MotionConfig
from vnca.losses.appearance import Appearance, AppearanceLoss
from vnca.training.config import PoolConfig, SmokeConfig
from vnca.training.ground import Ground
from vnca.training.loop import Trainer
from vnca.training.run import preview_sheet
from vnca.training.scenes import Scene
from vnca.training.terms import Iteration, Term
from vnca.training.trainers import smoke_trainer

Make = Callable[..., Trainer]


@pytest.fixture
def trainer(tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16) -> Make:
    """Makes a trainer of the tiny training with some options changed."""
    return lambda **options: smoke_trainer(tiny_smoke, style, replace(tiny_config, **options), vgg)


def weights(trainer: Trainer) -> list[FloatArray]:
    rule = trainer.rule()
    return [rule.hidden, rule.bias, rule.output]


def same(a: Trainer, b: Trainer) -> bool:
    return all(map(np.array_equal, weights(a), weights(b)))


def test_training_brings_the_painting_nearer_to_the_style(trainer: Make) -> None:
    learning = trainer(iterations=30, shortest_rollout=6, longest_rollout=6)
    losses = [step.loss for step in learning.run()]
    # All grey at first; views differ from one to the next.
    assert np.mean(losses[-10:]) < 0.8 * np.mean(losses[:2])


def test_same_seed_same_weights_and_another_seed_others(trainer: Make) -> None:
    one, two, other = trainer(seed=7), trainer(seed=7), trainer(seed=8)
    for training in (one, two, other):
        list(training.run())
    assert same(one, two)
    assert not same(one, other)


def test_looking_at_previews_changes_nothing(trainer: Make, style: FloatArray) -> None:
    looked, unseen = trainer(), trainer()
    for _ in looked.run():
        sheet = preview_sheet(looked, style)
        assert sheet.ndim == 3
    list(unseen.run())
    assert same(looked, unseen)


def test_training_stops_after_the_iterations_and_goes_on_where_it_was(trainer: Make) -> None:
    training = trainer(iterations=3)
    assert next(training.run()).iteration == 1
    assert [step.iteration for step in training.run()] == [2, 3]
    assert list(training.run()) == []


def test_the_learning_rate_falls_at_the_milestones(trainer: Make) -> None:
    training = trainer(
        iterations=10, learning_rate=0.01, rate_warmup=0, milestones=(0.3, 0.8), decay=0.1
    )
    rates = [training.learning_rate for _ in training.run()]
    # The rate that the next iteration will have.
    np.testing.assert_allclose(rates, [0.01] * 2 + [1e-3] * 5 + [1e-4] * 3)


def test_each_gradient_has_unit_length(trainer: Make) -> None:
    training = trainer()
    seen: list[float] = []

    def look(*_: object) -> None:
        seen.extend(float(w.grad.norm()) for w in training._weights if w.grad is not None)

    training._descent._adam.register_step_pre_hook(look)
    list(training.run())
    # W2 starts at zero, so nothing reaches the hidden layer in the first iteration.
    np.testing.assert_allclose([norm for norm in seen if norm > 0], 1, rtol=1e-5)
    assert seen[:2] == [0, 0]
    assert len(seen) == 9


@pytest.mark.parametrize("what", ["loss", "gradient"])
def test_nothing_that_is_not_finite_reaches_a_weight(
    trainer: Make, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    training = trainer(iterations=4)
    compare = AppearanceLoss.__call__

    def poisoned(self: AppearanceLoss, picture: torch.Tensor, *rest: object) -> Appearance:
        appearance = compare(self, picture, *rest)  # type: ignore[arg-type]
        if training.iteration in (0, 2):
            nan = picture.sum() * float("nan")
            # The gradient of the second is NaN, its value zero.
            poison = nan if what == "loss" else torch.sqrt(0 * picture.sum())
            terms = {**appearance.terms, "style": appearance.terms["style"] + poison}
            appearance = Appearance(appearance.total + poison, terms)
        return appearance

    monkeypatch.setattr(AppearanceLoss, "__call__", poisoned)
    before = weights(training)
    training.improve()
    assert all(map(np.array_equal, before, weights(training)))
    list(training.run())
    assert all(np.isfinite(w).all() for w in weights(training))
    assert not np.array_equal(before[2], weights(training)[2])


def test_exploded_states_are_told_and_do_not_stay(trainer: Make) -> None:
    training = trainer(
        iterations=8, learning_rate=50.0, pool=PoolConfig(size=2, reseed_every=10**9, limit=2.0)
    )
    steps = list(training.run())
    assert any(step.exploded for step in steps)
    assert all(state.abs().max() <= 2 for state in training._grounds[0].pool._states.values())
    assert all(np.isfinite(w).all() for w in weights(training))


def test_states_live_on_from_iteration_to_iteration(trainer: Make) -> None:
    training = trainer(iterations=4, pool=PoolConfig(size=1, reseed_every=10**9))
    starts: list[bool] = []
    roll = training._roll

    def look(ground: Ground, state: torch.Tensor, steps: range, scene: Scene[Any]) -> torch.Tensor:
        starts.append(bool(state.any()))
        return roll(ground, state, steps, scene)

    training._roll = look  # type: ignore[method-assign,assignment]
    list(training.run())
    # The first rollout of a rule that does nothing yet leaves zeros behind.
    assert starts == [False, False, True, True]


def test_no_two_rollouts_share_a_mask(trainer: Make) -> None:
    training = trainer(iterations=5)
    numbers: list[int] = []
    roll = training._roll

    def look(ground: Ground, state: torch.Tensor, steps: range, scene: Scene[Any]) -> torch.Tensor:
        numbers.extend(steps)
        return roll(ground, state, steps, scene)

    training._roll = look  # type: ignore[method-assign,assignment]
    list(training.run())
    assert numbers == list(range(len(numbers)))
    assert 5 * 2 <= len(numbers) <= 5 * 4


def test_augmentation_changes_what_is_learned(trainer: Make) -> None:
    moved = MotionConfig(weight=1.0)
    still, turned = (
        trainer(iterations=6, motion=moved, augment=augment) for augment in (False, True)
    )
    for training in (still, turned):
        list(training.run())
    assert not same(still, turned)


def test_terms_are_told_and_add_up(trainer: Make) -> None:
    step = trainer().improve()
    assert set(step.terms) == {"style", "moments", "pixels", "overflow"}
    assert sum(step.terms.values()) == pytest.approx(step.loss, rel=1e-5)


def test_the_native_kernel_and_the_reference_learn_alike(trainer: Make) -> None:
    native, reference = (trainer(iterations=2, backend=name) for name in ("native", "reference"))
    for training in (native, reference):
        list(training.run())
    for ours, theirs in zip(weights(native), weights(reference), strict=True):
        # Where a gradient is nearly zero, Adam steps by the sign of its rounding: in a fiftieth of
        # the weights, or in one of a few.
        assert np.sum(abs(ours - theirs) > 5e-4) <= max(1, 0.02 * ours.size)


@pytest.mark.parametrize("backend", ["native", "reference"])
def test_states_that_are_computed_again_change_nothing(trainer: Make, backend: str) -> None:
    plain, frugal = (
        trainer(shortest_rollout=6, longest_rollout=9, backend=backend) for _ in range(2)
    )
    frugal.kept_states = 5
    assert [step.loss for step in plain.run()] == [step.loss for step in frugal.run()]
    assert same(plain, frugal)


def test_smoke_of_any_units_gives_the_same_rule(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    assert tiny_smoke.velocity is not None
    other = replace(tiny_smoke, density=64 * tiny_smoke.density, velocity=8 * tiny_smoke.velocity)
    one, two = (smoke_trainer(smoke, style, tiny_config, vgg) for smoke in (tiny_smoke, other))
    for training in (one, two):
        list(training.run())
    for ours, theirs in zip(weights(one), weights(two), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-3)


@pytest.mark.parametrize("mode", ["emission-absorption", "paper"])
def test_smoke_without_velocity_trains_with_either_integrand(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16, mode: str
) -> None:
    config = replace(tiny_config, view=replace(tiny_config.view, mode=mode))  # type: ignore[arg-type]
    training = smoke_trainer(replace(tiny_smoke, velocity=None), style, config, vgg)
    assert all(np.isfinite(step.loss) for step in training.run())
    assert training.rule().scales.velocity == 1


def test_the_rule_it_gives_is_a_copy(trainer: Make) -> None:
    training = trainer()
    first = training.rule()
    kept = first.output.copy()
    list(training.run())
    np.testing.assert_array_equal(first.output, kept)


def test_a_term_of_ones_own_is_part_of_the_loss(
    trainer: Make, tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    class Darkness(Term):
        name = "darkness"

        def __call__(self, seen: Iteration) -> dict[str, torch.Tensor]:
            assert list(seen.sums) == ["appearance", "overflow"]
            return {"darkness": 3 * seen.pictures.mean()}

    plain = next(trainer().run())
    own = smoke_trainer(tiny_smoke, style, tiny_config, vgg, terms=[Darkness()])
    judged = next(own.run())
    assert judged.terms["darkness"] > 0
    assert judged.loss == pytest.approx(plain.loss + judged.terms["darkness"], rel=1e-5)
    assert {**judged.terms, "darkness": 0} == {**plain.terms, "darkness": 0}
