import math
from typing import Any

import pytest

from vnca.core.errors import OptionError
from vnca.losses import MotionConfig
from vnca.rule import RuleConfig
from vnca.training.config import PoolConfig, SmokeConfig, ViewConfig


@pytest.mark.parametrize(
    ("config", "option", "value"),
    [
        (SmokeConfig, "iterations", 0),
        (SmokeConfig, "learning_rate", 0.0),
        (SmokeConfig, "learning_rate", math.nan),
        (SmokeConfig, "decay", math.inf),
        (SmokeConfig, "milestones", (100.0, 200.0)),
        (SmokeConfig, "shortest_rollout", 0),
        (SmokeConfig, "overflow", math.nan),
        (SmokeConfig, "steadiness", -1.0),
        (SmokeConfig, "consistency", -1.0),
        (SmokeConfig, "mass", math.inf),
        (SmokeConfig, "texture", -1.0),
        (SmokeConfig, "texture", 1001.0),
        (SmokeConfig, "seed", -1),
        (SmokeConfig, "seed", 2**64),
        (ViewConfig, "size", 31),
        (ViewConfig, "azimuths", (0.0, 361.0)),
        (ViewConfig, "azimuths", (math.nan,)),
        (ViewConfig, "elevation", 91.0),
        (ViewConfig, "step", math.nan),
        (ViewConfig, "cell_opacity", 1.0),
        (ViewConfig, "gamma", math.inf),
        (PoolConfig, "size", 0),
        (PoolConfig, "reseed_every", 0),
        (PoolConfig, "limit", math.nan),
    ],
)
def test_values_that_cannot_work_are_refused_by_the_name_of_their_option(
    config: type, option: str, value: Any
) -> None:
    with pytest.raises(OptionError, match=option):
        config(**{option: value})


def test_a_rollout_is_not_shorter_than_its_shortest() -> None:
    with pytest.raises(OptionError, match="`longest_rollout`"):
        SmokeConfig(shortest_rollout=9, longest_rollout=8)


def test_the_learning_rate_rises_to_its_height_and_falls_at_each_milestone() -> None:
    config = SmokeConfig(
        iterations=10, learning_rate=0.8, rate_warmup=3, milestones=(0.5, 0.8), decay=0.5
    )
    rates = [config.rate(iteration) for iteration in range(10)]
    assert rates == pytest.approx([0.2, 0.4, 0.6, 0.8, 0.8, 0.4, 0.4, 0.4, 0.2, 0.2])


def test_a_pattern_is_not_both_carried_and_taught_to_move() -> None:
    carried = RuleConfig(transport=True)
    with pytest.raises(OptionError, match=r"motion\.weight` 1: .*transport"):
        SmokeConfig(rule=carried)
    SmokeConfig(rule=carried, motion=MotionConfig(weight=0.0))
