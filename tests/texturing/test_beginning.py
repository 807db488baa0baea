from dataclasses import replace

import numpy as np
import pytest

from vnca.losses.appearance import AppearanceConfig
from vnca.recipe.texture import LARGEST_PICTURE, pretraining_config, without_prior_weights
from vnca.rule import PRIORS, Rule, Scales
from vnca.training.config import SmokeConfig
from vnca.training.presets import preset


def test_the_texture_is_of_the_rule_and_the_picture_that_smoke_is_trained_with() -> None:
    config = replace(
        preset(SmokeConfig, "draft"),
        iterations=50,
        texture=2.5,
        seed=3,
        appearance=AppearanceConfig(style_scale=0.75, style=0.5, distribution=2.0, grey=True),
    )
    texture = pretraining_config(config, picture=60)
    assert texture is not None
    assert texture.iterations == 125
    assert texture.seed == 3
    assert texture.rule.hidden == config.rule.hidden
    assert texture.decoder == config.decoder
    assert texture.rule.sobel_divisor == config.rule.sobel_divisor
    assert 0 < texture.steadiness < 0.5 * config.steadiness  # or it stays what it began with
    assert texture.appearance.style_scale * texture.slice.cells == pytest.approx(60)
    told = replace(texture.appearance, style_scale=0.75, grey=True)
    assert told == config.appearance  # but for what shapes a density, compared by the same terms


def test_the_patterns_of_a_large_picture_are_kept_within_the_block() -> None:
    texture = pretraining_config(preset(SmokeConfig, "standard"), picture=1000)
    assert texture is not None
    assert texture.appearance.style_scale * texture.slice.cells == LARGEST_PICTURE


def test_the_paper_begins_with_nothing() -> None:
    assert pretraining_config(preset(SmokeConfig, "paper"), picture=64) is None


def test_a_rule_that_is_deaf_to_priors_is_otherwise_the_same() -> None:
    rule = Rule.initial(preset(SmokeConfig, "draft").rule, Scales(), seed=0)
    deaf = without_prior_weights(rule)
    assert not deaf.hidden[:, -PRIORS:].any()
    np.testing.assert_array_equal(deaf.hidden[:, :-PRIORS], rule.hidden[:, :-PRIORS])
    assert rule.hidden[:, -PRIORS:].all()
