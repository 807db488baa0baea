"""Training of one rule in several styles."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.features.vgg import VGG16
from vnca.rule.conditioning import STYLES
from vnca.training.config import PoolConfig, SliceConfig, SmokeConfig
from vnca.training.loop import Trainer
from vnca.training.scenes.texture import BlockScene, Cut
from vnca.training.styles import Lessons, Mix, shared_out, told_styles
from vnca.training.trainers import smoke_trainer

Make = Callable[..., Trainer]


@pytest.fixture
def pictures() -> list[FloatArray]:
    """Red with dark lines, and blue with pale ones."""
    lines = (np.arange(48) // 4 % 2)[:, None, None].astype(np.float32)
    ground, line = np.array([[0.7, 0.05, 0.02], [0.02, 0.05, 0.6]]), np.array([0.05, 0.9])
    return [
        np.broadcast_to(g + lines * (v - g), (48, 48, 3)).astype(np.float32)
        for g, v in zip(ground, line, strict=True)
    ]


@pytest.fixture
def trainer(
    tiny_smoke: Volume, pictures: list[FloatArray], tiny_config: SmokeConfig, vgg: VGG16
) -> Make:
    config = replace(tiny_config, pool=PoolConfig(size=4, reseed_every=3))
    return lambda **options: smoke_trainer(tiny_smoke, pictures, replace(config, **options), vgg)


def same(one: Trainer, two: Trainer) -> bool:
    ours, theirs = (t.rule() for t in (one, two))
    return all(
        np.array_equal(getattr(ours, name), getattr(theirs, name))
        for name in ("hidden", "bias", "output")
    )


def test_each_style_comes_nearer_to_its_own_picture(trainer: Make) -> None:
    learning = trainer(iterations=60, shortest_rollout=6, longest_rollout=6, learning_rate=5e-3)
    list(learning.run())
    red, blue = (learning.grow(6, style)[:-1, :3].mean(0) for style in (0, 1))
    assert red[0] - red[2] > 0.05 + float(blue[0] - blue[2])


def test_same_seed_same_weights_and_interrupted_the_same(trainer: Make) -> None:
    one, two = trainer(iterations=6), trainer(iterations=6)
    list(one.run())
    for _ in range(3):
        two.improve()
    resumed = trainer(iterations=6)
    resumed.restore(two.snapshot())
    list(resumed.run())
    assert same(one, resumed)
    other = trainer(iterations=6, seed=1)
    list(other.run())
    assert not same(one, other)


def test_looking_at_a_style_changes_nothing(trainer: Make) -> None:
    looked, unseen = trainer(), trainer()
    for _ in looked.run():
        looked.grow(3, 1)
    list(unseen.run())
    assert same(looked, unseen)


DOMAIN = Domain.filling(BlockScene(8, SliceConfig(size=32)).domain.box)


def test_lessons_are_the_same_again_and_of_all_kinds() -> None:
    lessons, again = Lessons(3, DOMAIN, 5), Lessons(3, DOMAIN, 5)
    kinds: Counter[str] = Counter()
    styles: Counter[int] = Counter()
    for life in range(600):
        mix, other = lessons.of(life, 0), again.of(life, 0)
        np.testing.assert_array_equal(mix.share, other.share)
        assert (mix.first, mix.second) == (other.first, other.second)
        assert mix.first != mix.second
        masked = isinstance(mix.share, np.ndarray)
        kinds["masked" if masked else "sole" if mix.share == 0 else "even"] += 1
        styles[mix.first] += 1
        if masked:
            assert np.min(mix.share) >= 0
            assert np.max(mix.share) <= 1
    assert 0.5 < kinds["sole"] / 600 < 0.7
    assert 0.1 < kinds["even"] / 600 < 0.2
    assert 0.2 < kinds["masked"] / 600 < 0.3
    assert all(170 < count < 230 for count in styles.values())


def test_a_life_keeps_to_a_lesson_for_some_time_and_tells_how_long() -> None:
    lessons = Lessons(4, DOMAIN, 0)
    changes = 0
    for life in range(40):
        before = lessons.of(life, 0)
        assert before.age == 0
        for age in range(1, 12):
            now = lessons.of(life, age)
            if now.age == 0:
                changes += 1
            else:
                assert now.age == before.age + 1
                assert (now.first, now.second) == (before.first, before.second)
                np.testing.assert_array_equal(now.share, before.share)
            before = now
    assert 0.2 < changes / (40 * 11) < 0.4


def test_masks_go_smoothly_from_one_style_to_the_other() -> None:
    domain = BlockScene(16, SliceConfig(size=32)).domain
    masks = [
        mix.share
        for life in range(80)
        if isinstance((mix := Lessons(2, domain, 0).of(life, 0)).share, np.ndarray)
    ]
    assert len(masks) > 10
    for mask in masks:
        assert np.min(mask) < 0.05 < 0.95 < np.max(mask)
    widths = [np.mean((mask > 0.01) & (mask < 0.99)) for mask in masks]
    assert min(widths) < 0.15
    assert max(widths) > 0.3


def test_the_rule_is_told_the_shares_and_the_scene_stays_as_it_was() -> None:
    scene = BlockScene(8, SliceConfig(size=32), conditioning_width=9)
    mask = np.linspace(0, 1, len(scene.domain)).astype(np.float32)
    told = Mix(0, 1, mask, 0).asked(scene, slice(7, 9))
    np.testing.assert_array_equal(told.priors[:, 8], mask)
    np.testing.assert_array_equal(told.priors.sum(1), 1)
    assert not scene.priors.any()


def test_pixels_are_judged_by_the_style_that_they_show() -> None:
    scene = BlockScene(16, SliceConfig(size=32, supersampling=1))
    right = (scene.domain.cells[:, 0] >= 8).astype(np.float32)
    random = np.random.default_rng(0)
    points = torch.stack(torch.meshgrid(*[torch.arange(32.0)] * 2, indexing="ij"), -1) / 2
    cut = [Cut(torch.cat([points, torch.full((32, 32, 1), 3.0)], -1), None)]
    seen = scene.seen_shares(torch.from_numpy(right), cut)
    assert seen.shape == (1, 32, 32)
    found: Counter[int] = Counter()
    for _ in range(40):
        style, where = Mix(3, 5, right, 0).judged(scene, cut, random)
        assert where is not None
        inside = where[0, 17:30].float().mean(), where[0, 1:14].float().mean()
        assert inside == ((1, 0) if style == 5 else (0, 1))
        found[style] += 1
    assert 10 < found[3] < 30


def test_a_mixture_everywhere_is_judged_by_either_as_its_share_is() -> None:
    scene, random = BlockScene(8, SliceConfig(size=32)), np.random.default_rng(0)
    drawn = [Mix(0, 1, 0.25, 0).judged(scene, [], random) for _ in range(400)]
    assert all(where is None for _, where in drawn)
    assert 70 < sum(style for style, _ in drawn) < 130
    assert {Mix(0, 1, 0.0, 0).judged(scene, [], random).style for _ in range(40)} == {0}


def test_smoke_shows_the_share_of_what_it_hides(trainer: Make) -> None:
    scene = trainer().scene
    viewpoint = scene.viewpoint(np.random.default_rng(0))
    state = scene.seed(6)
    _, opacity = scene.pictures(state, viewpoint, torch.zeros(3))
    for share in (0.0, 0.3, 1.0):
        seen = scene.seen_shares(torch.full((len(scene.domain),), share), viewpoint)
        assert seen.shape == opacity.shape
        np.testing.assert_allclose(seen[opacity > 0.5], share, atol=0.02)


def test_more_pictures_take_more_iterations_but_not_as_many_more(tiny_config: SmokeConfig) -> None:
    config = replace(tiny_config, iterations=100)
    assert [shared_out(config, count).iterations for count in (1, 2, 4, 8)] == [100, 141, 200, 283]


def test_pictures_are_as_many_as_the_rule_is_told(
    tiny_config: SmokeConfig, pictures: list[FloatArray]
) -> None:
    config = told_styles(tiny_config, pictures)
    assert config.rule.conditioning[-2:] == STYLES[:2]
    assert told_styles(config, pictures) == config
    assert told_styles(tiny_config, pictures[0]) == tiny_config
    with pytest.raises(OptionError, match="9 pictures; expected 1 to 8"):
        told_styles(tiny_config, pictures[:1] * 9)
    with pytest.raises(OptionError, match="the shares of 2 styles; there are 3"):
        told_styles(config, pictures[:1] * 3)
