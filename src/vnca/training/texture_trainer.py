"""Training of a solid texture: the trainer of a block and a picture.

Reference: VNCA section 5; slices of a solid as in Kopf et al. 2007.
"""

import dataclasses

import numpy as np
import torch

from vnca.core.typing import FloatArray
from vnca.features.network import FeatureNetwork
from vnca.io.mesh import Mesh
from vnca.rule.rule import Rule, Scales
from vnca.training.loop import Trainer
from vnca.training.scenes.texture import BlockScene
from vnca.training.texture_config import TextureConfig


def texture_trainer(
    style: FloatArray,
    config: TextureConfig,
    network: FeatureNetwork,
    *,
    mesh: Mesh | None = None,
    device: torch.device | str = "cpu",
    memory_budget: int | None = None,
) -> Trainer:
    """What trains a rule to grow blocks that look like a picture wherever they are cut.

    Args:
        style: Linear RGB `[r, c, 3]`.
        config: The hyperparameters.
        network: The frozen network that judges pictures.
        mesh: Looked at beside the slices.
        device: Where to compute.
        memory_budget: Bytes that the program may take; see `Trainer`.

    Raises:
        OptionError: If the memory budget is not enough.
    """
    rule = initial_rule(config)
    scene = BlockScene(
        config.block,
        config.slice,
        conditioning_width=config.rule.conditioning_width,
        mesh=mesh,
        decoder=rule.decoder,
        device=device,
        backend=config.backend,
    )
    return Trainer(scene, rule, style, config, network, memory_budget=memory_budget)


def initial_rule(config: TextureConfig) -> Rule:
    """A rule before training, with random biases.

    Where no prior tells cells anything, a block of zeros is perceived as zeros: without biases
    the hidden layer would stay silent, and its output weights without a gradient.
    """
    rule = Rule.initial(config.rule, Scales(), seed=config.seed)
    bound = config.rule.inputs**-0.5
    random = np.random.default_rng(config.seed)
    bias = random.uniform(-bound, bound, rule.bias.shape).astype(np.float32)
    return dataclasses.replace(rule, bias=bias, decoder=config.initial_decoder())
