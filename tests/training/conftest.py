"""A training small enough to run in a test."""

from importlib.resources import files

import pytest
from PIL import Image

from vnca.core import FloatArray
from vnca.features.vgg import VGG16
from vnca.io.picture import fit, read_image
from vnca.losses.appearance import AppearanceConfig
from vnca.rule import RuleConfig
from vnca.training.config import SmokeConfig, ViewConfig


@pytest.fixture(scope="session")
def vgg() -> VGG16:
    return VGG16.load("edges")


@pytest.fixture(scope="session")
def style(tmp_path_factory: pytest.TempPathFactory) -> FloatArray:
    path = tmp_path_factory.mktemp("style") / "style.png"
    with Image.open(str(files("vnca.data") / "vangogh_cafe_terrace.webp")) as image:
        image.convert("RGB").resize((64, 80)).save(path)
    return fit(read_image(path), 48, 48)


@pytest.fixture(scope="session")
def tiny_config() -> SmokeConfig:
    return SmokeConfig(
        rule=RuleConfig(channels=6, hidden=16, position_prior=False),
        view=ViewConfig(size=32),
        appearance=AppearanceConfig(
            samples=128, layers=("relu1_1", "relu2_1", "relu3_1"), style_scale=1.0
        ),
        iterations=3,
        rate_warmup=0,
        shortest_rollout=2,
        longest_rollout=4,
    )
