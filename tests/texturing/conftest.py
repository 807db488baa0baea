"""A rule that grows something, a picture, and the network that compares."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.features.vgg import VGG16
from vnca.losses.appearance import AppearanceConfig
from vnca.rule import Rule, RuleConfig
from vnca.training.config import SliceConfig, TextureConfig
from vnca.training.trainers import initial_rule


@pytest.fixture(scope="session")
def vgg() -> VGG16:
    return VGG16.load("edges")


@pytest.fixture(scope="session")
def style() -> FloatArray:
    """Blue and ochre checks, linear RGB."""
    at = np.add(*np.mgrid[:48, :48] // 8) % 2
    return np.array([[0.02, 0.05, 0.3], [0.6, 0.3, 0.05]], np.float32)[at]


@pytest.fixture(scope="session")
def tiny_config() -> TextureConfig:
    plain: dict[str, Any] = {f"{name}_prior": False for name in ("position", "density", "velocity")}
    return TextureConfig(
        rule=RuleConfig(channels=6, hidden=16, **plain),
        appearance=AppearanceConfig(
            samples=128, layers=("relu1_1", "relu2_1", "relu3_1"), style_scale=1.0
        ),
        slice=SliceConfig(size=32, count=1, pixels_per_cell=2.0),
        block=16,
        decoder=8,
        iterations=3,
        learning_rate=1e-3,
        rate_warmup=0,
        shortest_rollout=2,
        longest_rollout=4,
    )


@pytest.fixture(scope="session")
def rule(tiny_config: TextureConfig) -> Rule:
    """Random weights, whose block is uneven."""
    rule = initial_rule(tiny_config)
    output = np.random.default_rng(2).normal(0, 0.2, rule.output.shape).astype(np.float32)
    return replace(rule, output=output)
