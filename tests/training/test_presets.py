"""Every preset paints something, whatever its integrand."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.losses.appearance import AppearanceLoss
from vnca.rendering.colour import linear_to_srgb
from vnca.rule import Rule, Scales
from vnca.training.config import SmokeConfig
from vnca.training.presets import preset, preset_names
from vnca.training.scenes.smoke import SmokeScene
from vnca.training.trainers import choose_scales, smoke_trainer

GREY = 0.214
"""Linear, of sRGB ½."""
AROUND = (0.0, 90.0, 180.0, 270.0)


def small(config: SmokeConfig) -> SmokeConfig:
    """The training, so small that it takes a second."""
    layers = ("relu1_1", "relu2_1", "relu3_1")
    return replace(
        config,
        rule=replace(config.rule, channels=6, hidden=16),
        view=replace(config.view, size=32),
        pool=replace(config.pool, size=4),
        appearance=replace(config.appearance, layers=layers, samples=128),
        motion=replace(config.motion, weight=0.0),
        iterations=30,
        learning_rate=3e-3,
        rate_warmup=0,
        shortest_rollout=6,
        longest_rollout=6,
    )


@pytest.mark.parametrize("name", preset_names(SmokeConfig))
def test_a_few_iterations_of_every_preset_beat_even_grey(
    name: str, tiny_smoke: Volume, style: FloatArray, vgg: VGG16
) -> None:
    config = small(preset(SmokeConfig, name))
    trainer = smoke_trainer(tiny_smoke, style, config, vgg)
    list(trainer.run())
    scene, state = trainer.scene, trainer.grow(12)
    assert isinstance(scene, SmokeScene)
    loss = AppearanceLoss(vgg, style, config.appearance, config.view.size)

    @torch.no_grad()
    def distance(picture: Tensor, opacity: Tensor) -> float:
        shown = linear_to_srgb(picture).permute(2, 0, 1)[None]
        return float(loss(shown, opacity[None], torch.Generator().manual_seed(0)).total)

    painted, grey = 0.0, 0.0
    for azimuth in AROUND:
        view = scene.look(state, scene.camera(azimuth, 0))
        even = replace(view, colour=GREY * view.opacity[..., None].expand(-1, -1, 3))
        painted += distance(view.over(loss.background), view.opacity)
        grey += distance(even.over(loss.background), view.opacity)
    assert painted < 0.95 * grey


def test_the_papers_preset_shows_smoke_as_bright_as_its_colour(tiny_smoke: Volume) -> None:
    config = small(preset(SmokeConfig, "paper"))
    rule = Rule.initial(config.rule, choose_scales(tiny_smoke, config), seed=0)
    scene = SmokeScene(tiny_smoke, rule, config.view)
    state = scene.seed(6)
    state[:-1, :3] = 0.5
    view = scene.look(state, scene.camera(0, 0))
    inside = view.opacity > 0.95
    assert inside.sum() > 50
    assert 0.7 < float(view.colour[inside].mean()) < 1.3


def test_the_authors_scaling_perceives_more_and_begins_smaller() -> None:
    theirs, papers = preset(SmokeConfig, "authors"), preset(SmokeConfig, "paper")
    rule = replace(papers.rule, sobel_divisor=2.0, laplacian_divisor=8.0)
    assert theirs == replace(papers, rule=rule, xavier_gain=0.2)
    plain, normal = (
        Rule.initial(theirs.rule, Scales(), seed=0, xavier_gain=gain).hidden for gain in (0.0, 0.2)
    )
    fans = sum(normal.shape)
    assert normal.std() == pytest.approx(0.2 * (2 / fans) ** 0.5, rel=0.02)
    assert abs(normal).max() > 3 * normal.std()  # not uniform
    assert plain.std() > 5 * normal.std()
