"""Training of a solid texture: roll a block out, cut it, compare the slice, improve the rule.

Reference: VNCA sections 3.4 and 5; slices of a solid as in Kopf et al. 2007.
"""

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from vnca.automaton.rule import DENSITY_CHANGE, Rule, Scales
from vnca.features.vgg import VGG16
from vnca.kernels.update.backend import torch_step
from vnca.kernels.update.mask import changing_rows
from vnca.kernels.update.reference import Weights
from vnca.kernels.update.stencil import stencil
from vnca.losses.appearance import AppearanceLoss
from vnca.losses.overflow import overflow
from vnca.texturing.config import TextureConfig
from vnca.texturing.scene import BlockScene
from vnca.typing import FloatArray


@dataclass(frozen=True)
class Progress:
    """What one iteration did.

    Attributes:
        iteration: Counted from 1.
        loss: The total that was minimised.
        terms: Its parts, weighted.
        exploded: Whether the state left the range and was thrown away.
    """

    iteration: int
    loss: float
    terms: dict[str, float]
    exploded: bool


class TextureTrainer:
    """A rule in training on a block and one style picture.

    Every random choice comes from `config.seed`: same seed, same machine, same rule. The rule
    leaves the density alone: smoke painted with it keeps its shape.

    Attributes:
        config: The hyperparameters.
        scene: The block.
        appearance: What judges its slices.
        iteration: Iterations done.
    """

    def __init__(
        self,
        scene: BlockScene,
        style: FloatArray,
        config: TextureConfig,
        vgg: VGG16,
    ) -> None:
        """Prepare training.

        Args:
            scene: The block; its device is where is computed.
            style: Linear RGB `[r, c, 3]`.
            config: The hyperparameters.
            vgg: The frozen network that judges pictures.
        """
        self.config, self.scene, self.iteration = config, scene, 0
        device = scene.priors.device
        self._rule = initial_rule(config)
        self._weights = Weights(
            *(
                torch.tensor(w, device=device, requires_grad=True)
                for w in (self._rule.hidden, self._rule.bias, self._rule.output)
            )
        )
        self._step = torch_step(config.backend, device=device.type)
        self._stencil = torch.from_numpy(
            stencil(
                sobel_divisor=config.rule.sobel_divisor,
                laplacian_divisor=config.rule.laplacian_divisor,
            )
        ).to(device)
        self.appearance = AppearanceLoss(vgg, style, config.appearance, config.slices.size)
        self._random = np.random.default_rng(config.seed)
        self._generator = torch.Generator().manual_seed(config.seed)
        self._pool: dict[int, Tensor] = {}  # the states that are not the seed
        self._optimiser = torch.optim.Adam(self._weights, lr=config.learning_rate)
        self._steps = 0  # of all rollouts: no two share a mask

    @property
    def learning_rate(self) -> float:
        """Adam's learning rate in the next iteration."""
        return self.config.rate(self.iteration)

    def run(self) -> Iterator[Progress]:
        """Train for the remaining iterations, one at a time."""
        while self.iteration < self.config.iterations:
            yield self.improve()

    def improve(self) -> Progress:
        """One iteration: rollout, slice, loss, gradient step."""
        config, pool = self.config, self.config.pool
        place = int(self._random.integers(pool.size))
        if self.iteration % pool.reseed_every == 0:
            self._pool.pop(place, None)
        start = self._pool.pop(place, None)
        steps = int(self._random.integers(config.shortest_rollout, config.longest_rollout + 1))
        state = self._roll(
            self._seed() if start is None else start, range(self._steps, self._steps + steps)
        )
        self._steps += steps
        pictures, opacity = self.scene.pictures(state, self._random, self.appearance.background)
        appearance = self.appearance(pictures, opacity, self._generator)
        cells = state[:-1]
        # Beyond ±½ a colour is clamped where it is shown, and learns nothing.
        penalty = config.overflow * (overflow(cells) + overflow(2 * cells[:, : DENSITY_CHANGE + 1]))
        loss = appearance.total + penalty
        # A NaN fails the comparison and so counts as exploded.
        kept = bool(state.detach().abs().max() <= pool.limit)
        if kept:
            self._pool[place] = state.detach()
        self._optimiser.zero_grad()
        if bool(torch.isfinite(loss)):
            loss.backward()
        self._normalise_gradients()
        self._optimiser.param_groups[0]["lr"] = self.learning_rate
        self._optimiser.step()
        self.iteration += 1
        terms = {name: float(value.detach()) for name, value in appearance.terms.items()}
        return Progress(
            iteration=self.iteration,
            loss=float(loss.detach()),
            terms={**terms, "overflow": float(penalty.detach())},
            exploded=not kept,
        )

    def grow(self, steps: int) -> Tensor:
        """A state grown from the seed, as baking does; no random stream moves."""
        with torch.no_grad():
            return self._roll(self._seed(), range(steps))

    def rule(self) -> Rule:
        """The rule as it is now."""
        hidden, bias, output = (w.detach().cpu().numpy().copy() for w in self._weights)
        return dataclasses.replace(self._rule, hidden=hidden, bias=bias, output=output)

    def _seed(self) -> Tensor:
        return self.scene.seed(self.config.rule.channels)

    def _roll(self, state: Tensor, steps: Iterable[int]) -> Tensor:
        """The state after the numbered steps of the rule; differentiable in the weights."""
        for step in steps:
            rows = changing_rows(
                self.scene.domain.hashes,
                seed=self.config.seed,
                step=step,
                probability=self.config.rule.update_probability,
            )
            state = self._step(
                state,
                torch.from_numpy(rows).to(state.device),
                self.scene.neighbours,
                self.scene.priors,
                self._weights,
                self._stencil,
            )
        return state

    def _normalise_gradients(self) -> None:
        """Give each gradient unit length: rollouts of any length then teach equally much.

        One that is not finite is dropped, and its weight stays as it is in this iteration. The
        weights that change the density stay zero.
        """
        if self._weights.output.grad is not None:
            self._weights.output.grad[DENSITY_CHANGE] = 0
        for weight in self._weights:
            if weight.grad is not None:
                norm = weight.grad.norm()
                weight.grad = weight.grad / (norm + 1e-8) if bool(norm.isfinite()) else None


def initial_rule(config: TextureConfig) -> Rule:
    """A rule before training, with random biases.

    Where no prior tells cells anything, a block of zeros is perceived as zeros: without biases
    the hidden layer would stay silent, and its output weights without a gradient.
    """
    rule = Rule.initial(config.rule, Scales(), seed=config.seed)
    bound = config.rule.inputs**-0.5
    random = np.random.default_rng(config.seed)
    bias = random.uniform(-bound, bound, rule.bias.shape).astype(np.float32)
    return dataclasses.replace(rule, bias=bias)
