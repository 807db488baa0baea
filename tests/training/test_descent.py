from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.core.errors import DivergenceError
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.losses.appearance import Appearance, AppearanceLoss
from vnca.training.config import SmokeConfig
from vnca.training.descent import KEEP_EVERY, MOST_ROLLBACKS, PATIENCE, Descent
from vnca.training.loop import Trainer
from vnca.training.trainers import smoke_trainer

NAN = torch.tensor(torch.nan)


class Slope:
    """A descent on one weight, at 1 for `KEEP_EVERY` iterations and a few more."""

    def __init__(self, *, iterations: int = KEEP_EVERY + 3) -> None:
        self.weight = torch.tensor([1.0], requires_grad=True)
        self.descent = Descent([self.weight])
        self.iteration = 0
        self.visited = [1.0]
        for _ in range(iterations):
            assert self.step()

    def step(self, loss: torch.Tensor | None = None, *, exploded: bool = False) -> bool:
        self.iteration += 1
        loss = self.weight.square().sum() if loss is None else loss
        went_on = self.descent.step(loss, 0.01, self.iteration, exploded=exploded)
        self.visited.append(self.weight.item())
        return went_on


def test_it_goes_down() -> None:
    slope = Slope()
    assert slope.visited == sorted(slope.visited, reverse=True)
    assert len(set(slope.visited)) == KEEP_EVERY + 4


def test_a_loss_that_is_not_finite_leads_back_to_good_weights_at_half_the_rate() -> None:
    slope = Slope()
    assert not slope.step(NAN)
    assert slope.weight.item() == slope.visited[KEEP_EVERY]
    assert slope.descent.kept_at == KEEP_EVERY
    assert slope.descent.slowdown == 0.5
    before = slope.weight.item()
    assert slope.step()
    twin = Slope(iterations=KEEP_EVERY)
    twin.step()
    assert before - slope.weight.item() == pytest.approx((before - twin.weight.item()) / 2)


def test_a_gradient_that_is_not_finite_leads_back() -> None:
    slope = Slope()
    assert not slope.step((slope.weight - slope.weight.detach()).sqrt().sum())
    assert slope.weight.item() == slope.visited[KEEP_EVERY]


def test_a_weight_that_is_not_finite_leads_back() -> None:
    slope = Slope()
    with torch.no_grad():
        slope.weight *= torch.inf
    assert not slope.step()
    assert slope.weight.item() == slope.visited[KEEP_EVERY]


def test_a_state_that_explodes_now_and_then_is_none_of_its_business() -> None:
    slope = Slope()
    for _ in range(PATIENCE):
        before = slope.weight.item()
        assert slope.step(NAN, exploded=True)
        assert slope.weight.item() == before
        assert slope.step()
    assert slope.descent.rollbacks == 0


def test_states_that_explode_one_after_the_other_lead_back() -> None:
    slope = Slope()
    for _ in range(PATIENCE - 1):
        assert slope.step(exploded=True)
    assert not slope.step(exploded=True)
    assert slope.weight.item() == slope.visited[KEEP_EVERY]
    assert slope.step(exploded=True)


def test_weights_are_not_kept_while_states_explode() -> None:
    slope = Slope(iterations=KEEP_EVERY)
    while slope.iteration < 2 * KEEP_EVERY - 1:
        slope.step()
    slope.step(exploded=True)
    assert slope.descent.kept_at == KEEP_EVERY


def test_a_restored_descent_goes_on_as_the_first_does() -> None:
    one, two = Slope(), Slope()
    one.step(NAN)
    one.step(exploded=True)
    two.descent.restore(one.descent.snapshot())
    for slope in (one, two):
        for _ in range(4):
            slope.step()
        slope.step(NAN)
        slope.step()
    assert one.visited[-6:] == two.visited[-6:]
    assert one.descent.rollbacks == two.descent.rollbacks == 2


@pytest.fixture
def trainer(tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16) -> Trainer:
    return smoke_trainer(tiny_smoke, style, replace(tiny_config, iterations=20), vgg)


def test_training_gives_up_after_three_lower_rates_with_the_last_good_weights(
    trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    compare, good = AppearanceLoss.__call__, KEEP_EVERY

    def poisoned(self: AppearanceLoss, picture: torch.Tensor, *rest: object) -> Appearance:
        appearance = compare(self, picture, *rest)  # type: ignore[arg-type]
        poison = torch.nan if trainer.iteration > good else 0.0
        terms = {name: term * (1 + poison) for name, term in appearance.terms.items()}
        return Appearance(appearance.total * (1 + poison), terms)

    monkeypatch.setattr(AppearanceLoss, "__call__", poisoned)
    training = trainer.run()
    assert not any(step.diverged for step in islice(training, good))
    kept = trainer.rule()
    assert not next(training).diverged
    for times in range(1, MOST_ROLLBACKS + 2):
        assert next(training).diverged
        assert trainer.learning_rate == trainer.config.rate(trainer.iteration) / 2**times
    with pytest.raises(DivergenceError, match=r"4 times.*iteration 10 are kept.*`learning_rate`"):
        next(training)
    np.testing.assert_array_equal(trainer.rule().output, kept.output)
    assert MOST_ROLLBACKS == 3


def test_an_absurd_learning_rate_is_lowered_until_states_stay_whole(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    config = replace(
        tiny_config, iterations=PATIENCE + 5, learning_rate=50, shortest_rollout=8,
        longest_rollout=8,
    )  # fmt: skip
    training = smoke_trainer(tiny_smoke, style, config, vgg)
    steps = list(training.run())
    assert [step.diverged for step in steps].count(True) == 1
    assert training.learning_rate <= 25
    assert all(np.isfinite(w).all() for w in (training.rule().hidden, training.rule().output))
