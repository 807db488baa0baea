"""Training: roll a state out, look at it, compare it with the style, improve the rule.

Reference: VNCA section 3.4.
"""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from vnca.automaton.rule import DENSITY_CHANGE, Rule, Scales
from vnca.camera import Camera
from vnca.errors import DivergenceError
from vnca.features.flow import FlowNetwork
from vnca.features.vgg import VGG16
from vnca.kernels.update.backend import torch_step
from vnca.kernels.update.mask import changing_rows
from vnca.kernels.update.reference import Weights
from vnca.kernels.update.stencil import stencil
from vnca.losses.appearance import AppearanceLoss
from vnca.losses.motion import Motion
from vnca.losses.overflow import overflow
from vnca.render.brightness import gamma_for_cell_opacity
from vnca.render.colour import linear_to_srgb
from vnca.training.config import TrainConfig
from vnca.training.descent import MOST_RETREATS, Descent
from vnca.training.motion import MotionSupervision
from vnca.training.pool import Pool
from vnca.training.scene import Scene, density_scale, velocity_scale
from vnca.training.snapshot import Snapshot, count
from vnca.typing import FloatArray
from vnca.volume import Volume


@dataclass(frozen=True)
class Progress:
    """What one iteration did.

    Attributes:
        iteration: Counted from 1.
        loss: The total that was minimised.
        terms: Its parts, weighted.
        exploded: Whether the state left the range and was thrown away.
        diverged: Whether training went back to earlier weights, to go on at half the rate.
    """

    iteration: int
    loss: float
    terms: dict[str, float]
    exploded: bool
    diverged: bool = False


class Trainer:
    """A rule in training on one frame and one style picture.

    Every random choice comes from `config.seed`: same seed, same machine, same rule.

    Attributes:
        config: The hyperparameters.
        scene: The frame.
        step: What computes the automaton, called as `vnca.kernels.update.reference.update` is;
            another that does the same may take its place.
        iteration: Iterations done.
    """

    def __init__(
        self,
        smoke: Volume,
        style: FloatArray,
        config: TrainConfig,
        vgg: VGG16,
        *,
        device: torch.device | str = "cpu",
    ) -> None:
        """Prepare training.

        Args:
            smoke: The frame.
            style: Linear RGB `[r, c, 3]`.
            config: The hyperparameters.
            vgg: The frozen network that judges pictures.
            device: Where to compute.

        Raises:
            GridError: If there is no smoke in the frame.
        """
        self.config = config
        self.iteration = 0
        rule = Rule.initial(config.rule, choose_scales(smoke, config), seed=config.seed)
        self._rule = rule
        self.scene = Scene(smoke, rule, device=device)
        self._weights = Weights(
            *(
                torch.tensor(w, device=device, requires_grad=True)
                for w in (rule.hidden, rule.bias, rule.output)
            )
        )
        self.step = torch_step(config.backend, device=torch.device(device).type)
        self._stencil = torch.from_numpy(
            stencil(
                sobel_divisor=config.rule.sobel_divisor,
                laplacian_divisor=config.rule.laplacian_divisor,
            )
        ).to(device)
        self._appearance = AppearanceLoss(vgg, style, config.appearance, config.view.size)
        self._random = np.random.default_rng(config.seed)
        self._generator = torch.Generator().manual_seed(config.seed)
        self._pool = Pool(self.scene.seed(config.rule.channels), config.pool, self._random)
        self._descent = Descent(self._weights)
        self._motion = None
        if config.motion.weight and self.scene.moves:
            self._motion = MotionSupervision(config.motion, FlowNetwork.load(device))
        self._steps = 0  # of all rollouts: no two share a mask
        self._before: dict[str, Snapshot] | None = None  # the iteration that is under way

    @property
    def background(self) -> Tensor:
        """Linear RGB `[3]` that pictures are composited over: the style's mean colour."""
        return self._appearance.background

    @property
    def learning_rate(self) -> float:
        """Adam's learning rate in the next iteration."""
        return self.config.rate(self.iteration) * self._descent.slowdown

    @property
    def good_iteration(self) -> int:
        """The iteration whose weights training goes back to when it diverges."""
        return self._descent.kept_at

    def run(self) -> Iterator[Progress]:
        """Train for the remaining iterations, one at a time.

        Raises:
            DivergenceError: If training diverged and lower learning rates did not help. The
                weights are then the last that were good.
        """
        while self.iteration < self.config.iterations:
            yield self.improve()

    def improve(self) -> Progress:
        """One iteration: rollout, picture, loss, gradient step.

        Raises:
            DivergenceError: As `run` does.
        """
        self.undo()
        if self._descent.is_exhausted:
            raise DivergenceError(
                f"training has diverged {MOST_RETREATS + 1} times, the last at iteration "
                f"{self.iteration}, though the learning rate was halved each time; the weights of "
                f"iteration {self.good_iteration} are kept: choose a --learning-rate far below "
                f"{self.config.learning_rate:g}"
            )
        self._before = self.snapshot()
        progress = self._improve()
        self._before = None
        return progress

    def undo(self) -> None:
        """Forget an iteration that was interrupted, as if it had not begun."""
        if self._before is not None:
            self.restore(self._before)

    def snapshot(self) -> dict[str, Snapshot]:
        """All that changes in training, by part, as it was after the last whole iteration."""
        if self._before is not None:
            return self._before
        values = {
            "iteration": self.iteration,
            "steps": self._steps,
            "random": self._random.bit_generator.state,
        }
        own = Snapshot({"generator": self._generator.get_state()}, values)
        parts = {name: part.snapshot() for name, part in self._parts().items()}
        return {"trainer": own, **parts}

    def restore(self, snapshot: Mapping[str, Snapshot]) -> None:
        """Go on from a snapshot of a trainer that was made of the same inputs.

        Raises:
            KeyError, RuntimeError, TypeError, ValueError: If it is not one.
        """
        own = snapshot["trainer"]
        self.iteration = count(own.values["iteration"], "iteration", most=self.config.iterations)
        self._steps = count(own.values["steps"], "steps")
        self._random.bit_generator.state = own.values["random"]
        self._generator.set_state(own.tensors["generator"])
        for name, part in self._parts().items():
            part.restore(snapshot[name])
        self._before = None

    def _parts(self) -> dict[str, Pool | Descent | MotionSupervision]:
        """What remembers something from one iteration to the next."""
        parts = {"pool": self._pool, "descent": self._descent}
        return parts if self._motion is None else {**parts, "motion": self._motion}

    def _improve(self) -> Progress:
        config = self.config
        place, before = self._pool.draw(self.iteration)
        steps = int(self._random.integers(config.shortest_rollout, config.longest_rollout + 1))
        state = self._roll(before, range(self._steps, self._steps + steps))
        self._steps += steps
        camera, offset = self._random_viewpoint()
        picture, opacity = self._picture(state, camera, offset)
        appearance = self._appearance(picture, opacity, self._generator)
        others = {"overflow": config.overflow * self._overflow(state[:-1])}
        if self._motion is not None and before.any():  # a state of zeros has no texture to move
            others["motion"] = self._motion.weighted(
                self._seen_motion(before, picture, camera, offset, steps),
                float(appearance.total.detach()),
            )
        loss = appearance.total + torch.stack([*others.values()]).sum()
        kept = self._pool.put(place, state)
        rate = config.rate(self.iteration)
        self.iteration += 1
        went_on = self._descent.step(loss, rate, self.iteration, exploded=not kept)
        return Progress(
            iteration=self.iteration,
            loss=float(loss.detach()),
            terms={k: float(v.detach()) for k, v in {**appearance.terms, **others}.items()},
            exploded=not kept,
            diverged=not went_on,
        )

    def grow(self, steps: int) -> Tensor:
        """A state grown from the seed, as stylizing does; no random stream moves."""
        with torch.no_grad():
            return self._roll(self.scene.seed(self.config.rule.channels), range(steps))

    def _roll(self, state: Tensor, steps: Iterable[int]) -> Tensor:
        """The state after the numbered steps of the rule; differentiable in the weights."""
        for step in steps:
            rows = changing_rows(
                self.scene.domain.hashes,
                seed=self.config.seed,
                step=step,
                probability=self.config.rule.update_probability,
            )
            state = self.step(
                state,
                torch.from_numpy(rows).to(state.device),
                self.scene.neighbours,
                self.scene.priors,
                self._weights,
                self._stencil,
            )
        return state

    def rule(self) -> Rule:
        """The rule as it is now."""
        hidden, bias, output = (w.detach().cpu().numpy().copy() for w in self._weights)
        return dataclasses.replace(self._rule, hidden=hidden, bias=bias, output=output)

    def _random_viewpoint(self) -> tuple[Camera, float]:
        """A camera anywhere around the smoke, and where along the rays sampling begins."""
        view = self.config.view
        azimuth = self._random.uniform(0, 360)
        elevation = self._random.uniform(-view.elevation, view.elevation)
        # Samples at random depths: no pattern can hide between them.
        offset = float(self._random.uniform()) if view.mode == "sane" else 0.0
        return self.scene.camera(azimuth, elevation), offset

    def _picture(self, state: Tensor, camera: Camera, offset: float) -> tuple[Tensor, Tensor]:
        """As the losses want it: sRGB `[1, 3, r, c]` and opacity `[1, r, c]`."""
        view = self.scene.look(state, camera, self.config.view, offset=offset)
        picture = linear_to_srgb(view.over(self.background))
        return picture.permute(2, 0, 1)[None], view.opacity[None]

    def _seen_motion(
        self, before: Tensor, picture: Tensor, camera: Camera, offset: float, steps: int
    ) -> Motion:
        """How the texture moved in a rollout, against how the smoke moves in that time."""
        assert self._motion is not None
        view, size = self.config.view, min(self.config.motion.size, self.config.view.size)
        with torch.no_grad():
            earlier, _ = self._picture(before, camera, offset)
        target, opacity = self.scene.motion(before, camera, view, size=size, offset=offset)
        frames = steps / self.config.rule.steps_per_frame
        return self._motion.compare(earlier, picture, target, opacity, frames=frames)

    @staticmethod
    def _overflow(cells: Tensor) -> Tensor:
        """States beyond ±1, and beyond ±½ where they are shown: a clamped colour learns nothing."""
        return overflow(cells) + overflow(2 * cells[:, : DENSITY_CHANGE + 1])


def choose_scales(smoke: Volume, config: TrainConfig) -> Scales:
    """Normalisers from the frame a rule is trained on."""
    density = density_scale(smoke.density)
    gamma = config.view.gamma or gamma_for_cell_opacity(
        smoke.density / density, config.view.cell_opacity
    )
    return Scales(density=density, velocity=velocity_scale(smoke), gamma=gamma)
