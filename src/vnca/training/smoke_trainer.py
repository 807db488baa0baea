"""Training on smoke: the trainer of a frame and a picture."""

from collections.abc import Sequence
from dataclasses import replace

import torch

from vnca.core.lattice import Lattice, Region
from vnca.core.typing import AnyArray, FloatArray
from vnca.core.volume import Volume
from vnca.features.flow import FlowNetwork
from vnca.features.network import FeatureNetwork
from vnca.io.smoke_format import on_lattice
from vnca.rendering.brightness import gamma_for_cell_opacity, gamma_for_own_colour
from vnca.rule.rule import Rule, Scales, density_scale
from vnca.training.loop import Trainer
from vnca.training.motion import MotionSupervision
from vnca.training.scenes.smoke import SmokeScene, velocity_scale
from vnca.training.smoke_config import SmokeConfig, ViewConfig
from vnca.training.terms import Term


def smoke_trainer(
    smoke: Volume,
    style: FloatArray,
    config: SmokeConfig,
    network: FeatureNetwork,
    *,
    device: torch.device | str = "cpu",
    memory_budget: int | None = None,
    terms: Sequence[Term] = (),
) -> Trainer:
    """What trains a rule on one frame and one picture.

    Args:
        smoke: The frame, which is laid on a lattice of its own.
        style: Linear RGB `[r, c, 3]`.
        config: The hyperparameters.
        network: The frozen network that judges pictures.
        device: Where to compute.
        memory_budget: Bytes that the program may take; see `Trainer`.
        terms: Further terms of the loss.

    Raises:
        GridError: If there is no smoke in the frame, or it can have no place on a lattice.
        OptionError: If the memory budget is not enough.
    """
    what = f"frame {smoke.frame}"
    smoke = on_lattice(smoke, Lattice.of(smoke.index_to_world, what), what)
    rule = Rule.initial(config.rule, choose_scales(smoke, config), seed=config.seed)
    rule = replace(rule, decoder=config.initial_decoder())
    scene = SmokeScene(
        smoke, rule, config.view, augment=config.augment, device=device, backend=config.backend
    )
    rule = replace(rule, place=Region(Lattice(smoke.index_to_world), scene.domain.box))
    if config.motion.weight and scene.moves:
        terms = (MotionSupervision(config.motion, FlowNetwork.load(device)), *terms)
    return Trainer(scene, rule, style, config, network, terms=terms, memory_budget=memory_budget)


def choose_scales(smoke: Volume, config: SmokeConfig) -> Scales:
    """Normalisers from the frame a rule is trained on."""
    density = density_scale(smoke.density)
    return Scales(
        density=density,
        velocity=velocity_scale(smoke),
        gamma=config.view.gamma or _gamma(smoke.density / density, config.view),
    )


def _gamma(density: AnyArray, view: ViewConfig) -> float:
    """What suits the integrand that training looks with."""
    if view.mode == "paper":
        return gamma_for_own_colour(density)
    return gamma_for_cell_opacity(density, view.cell_opacity)
