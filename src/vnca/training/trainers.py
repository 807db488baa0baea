"""The trainers: of a frame of smoke and a picture, and of a block of solid texture and one.

Reference: VNCA section 5; slices of a solid as in Kopf et al. 2007.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import torch

from vnca.core import AnyArray, FloatArray
from vnca.core.lattice import Lattice, Region
from vnca.core.volume import Volume
from vnca.features import FeatureNetwork
from vnca.features.flow import FlowNetwork
from vnca.io.mesh import Mesh
from vnca.io.smoke_format import on_lattice
from vnca.painting.flat import MotionField, without_depth
from vnca.rule import Rule, Scales, density_scale, gamma_for_cell_opacity, gamma_for_own_colour
from vnca.training.config import SmokeConfig, TextureConfig, ViewConfig
from vnca.training.loop import Trainer
from vnca.training.scenes.flat import FlatScene
from vnca.training.scenes.smoke import SmokeScene, velocity_scale
from vnca.training.scenes.texture import BlockScene
from vnca.training.styles import told_styles
from vnca.training.terms import MassTerm, MotionSupervision, Term


def smoke_trainer(
    smoke: Volume | Sequence[Volume],
    style: FloatArray | Sequence[FloatArray],
    config: SmokeConfig,
    network: FeatureNetwork,
    *,
    device: torch.device | str = "cpu",
    memory_budget: int | None = None,
    terms: Sequence[Term] = (),
) -> Trainer:
    """What trains a rule on a frame and a picture, or several of either.

    Args:
        smoke: The frame; or several, of one sequence or of others, which are trained on by turns.
            Each is laid on a lattice of its own and seen as large, in cells, as the first, by whose
            density and speed all are told what counts as 1.
        style: Linear RGB `[r, c, 3]`; or several, which the rule learns all.
        config: The hyperparameters.
        network: The frozen network that judges pictures.
        device: Where to compute.
        memory_budget: Bytes that the program may take; see `Trainer`.
        terms: Further terms of the loss.

    Raises:
        GridError: If there is no smoke in the frame, or it can have no place on a lattice.
        OptionError: If the memory budget is not enough.
    """
    first, *others = map(_on_own_lattice, [smoke] if isinstance(smoke, Volume) else smoke)
    config = told_styles(config, style)
    rule = Rule.initial(
        config.rule,
        choose_scales(first, config),
        seed=config.seed,
        xavier_gain=config.xavier_gain,
    )
    rule = replace(rule, decoder=config.initial_decoder())
    prepared = partial(
        SmokeScene, view=config.view, augment=config.augment, device=device, backend=config.backend
    )
    scene = prepared(first, rule)
    more_scenes = [prepared(other, rule, width=scene.width) for other in others]
    rule = replace(rule, place=Region(Lattice(first.index_to_world), scene.domain.box))
    if config.mass:
        terms = (MassTerm(config.mass), *terms)
    if config.motion.weight and any(each.moves for each in (scene, *more_scenes)):
        terms = (MotionSupervision(config.motion, FlowNetwork.load(device)), *terms)
    return Trainer(
        scene,
        rule,
        style,
        config,
        network,
        more_scenes=more_scenes,
        terms=terms,
        memory_budget=memory_budget,
    )


def _on_own_lattice(smoke: Volume) -> Volume:
    what = f"frame {smoke.frame}"
    return on_lattice(smoke, Lattice.of(smoke.index_to_world, what), what)


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


def texture_trainer(
    style: FloatArray | Sequence[FloatArray],
    config: TextureConfig,
    network: FeatureNetwork,
    *,
    mesh: Mesh | None = None,
    motion_field: MotionField | None = None,
    device: torch.device | str = "cpu",
    memory_budget: int | None = None,
) -> Trainer:
    """What trains a rule to grow blocks that look like a picture wherever they are cut.

    In two dimensions it is layers that look like the picture, and move if they are to.

    Args:
        style: Linear RGB `[r, c, 3]`; or several, which the rule learns all.
        config: The hyperparameters.
        network: The frozen network that judges pictures.
        mesh: Looked at beside the slices, of a solid texture.
        motion_field: How a flat texture is to move; the rule is told it.
        device: Where to compute.
        memory_budget: Bytes that the program may take; see `Trainer`.

    Raises:
        OptionError: If the memory budget is not enough.
    """
    config = told_styles(config, style)
    rule = initial_rule(config)
    if config.dimensions == 2:
        velocity = None
        if motion_field is not None:
            velocity = motion_field.velocity(config.block, config.block, config.motion_speed)
        scene = FlatScene(
            config.block,
            config.slice,
            rule,
            velocity=velocity,
            device=device,
            backend=config.backend,
        )
        terms = []
        if scene.moves and config.motion.weight:
            terms.append(MotionSupervision(config.motion, FlowNetwork.load(device)))
        return Trainer(
            scene, rule, style, config, network, terms=terms, memory_budget=memory_budget
        )
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
    is_flat = config.dimensions == 2
    scales = Scales(velocity=config.motion_speed) if is_flat else Scales()
    rule = Rule.initial(config.rule, scales, seed=config.seed, xavier_gain=config.xavier_gain)
    rule = without_depth(rule) if is_flat else rule
    bound = config.rule.inputs**-0.5
    random = np.random.default_rng(config.seed)
    bias = random.uniform(-bound, bound, rule.bias.shape).astype(np.float32)
    return dataclasses.replace(rule, bias=bias, decoder=config.initial_decoder())
