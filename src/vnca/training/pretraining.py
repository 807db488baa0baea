"""A solid texture for the training on smoke to begin with.

On smoke a rule learns first what the priors offer: a colour for each density and velocity, and
grain. In a block, where nothing tells cells apart, it has to learn patterns; from there it goes
on drawing them on smoke.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from vnca.engine.automaton import FILTERS
from vnca.rule.rule import Rule
from vnca.training.presets import DEFAULT, preset
from vnca.training.smoke_config import SmokeConfig
from vnca.training.texture_config import TextureConfig

AUTO = "auto"
"""In the place of the name of a style: the nearest to the picture."""
SHAPE = ("channels", "hidden", "update_probability", "sobel_divisor", "laplacian_divisor")
"""In what a rule must be like the texture that it begins with."""
LARGEST_PICTURE = 128
"""Cells along the shorter side of the picture, at most: its patterns are to fit the block."""


def pretraining_config(config: SmokeConfig, picture: float) -> TextureConfig | None:
    """How the texture is trained for a training on smoke, or None if it is not to be.

    Args:
        config: The training on smoke. The rule is as large, and the picture in cells too.
        picture: Cells along its shorter side, as the smoke is shown it.
    """
    iterations = round(config.texture * config.iterations)
    if iterations == 0:
        return None
    plain = preset(TextureConfig, DEFAULT)
    picture = min(picture, LARGEST_PICTURE)
    return dataclasses.replace(
        plain,
        rule=dataclasses.replace(
            config.rule, position_prior=False, density_prior=False, velocity_prior=False
        ),
        appearance=dataclasses.replace(
            plain.appearance,
            layers=config.appearance.layers,
            style_scale=picture / plain.slice.cells,
        ),
        decoder=config.decoder,
        graft=config.graft,
        iterations=iterations,
        features=config.features,
        backend=config.backend,
        seed=config.seed,
    )


def without_prior_weights(rule: Rule, conditioning: Sequence[str] | None = None) -> Rule:
    """The rule with no weight on any prior: a texture has had none to learn what they mean.

    Args:
        rule: A texture.
        conditioning: What the rule is to be conditioned on; as it is unless given.
    """
    config = rule.config
    if conditioning is not None:
        config = dataclasses.replace(config, conditioning=tuple(conditioning))
    perceived = FILTERS * config.channels
    hidden = np.zeros((config.hidden, config.inputs), np.float32)
    hidden[:, :perceived] = rule.hidden[:, :perceived]
    return dataclasses.replace(rule, hidden=hidden, config=config)
