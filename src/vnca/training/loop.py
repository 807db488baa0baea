"""Training: roll a state out, look at it, compare it with the style, improve the rule.

Reference: VNCA sections 3.4 and 5.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from vnca.core import FloatArray
from vnca.core.errors import DivergenceError
from vnca.engine import Compute, Session, open_session
from vnca.engine.automaton import DecoderWeights as Decoded
from vnca.engine.automaton import Weights
from vnca.features import FeatureNetwork
from vnca.losses.appearance import AppearanceLoss
from vnca.painting.flat import depth_columns
from vnca.rule import DENSITY_CHANGE, Decoder, Rule
from vnca.training import Snapshot, count
from vnca.training.config import TrainingConfig
from vnca.training.descent import MOST_ROLLBACKS, Descent
from vnca.training.ground import Ground
from vnca.training.rollout import Pool, roll_out, states_to_keep
from vnca.training.scenes import Scene
from vnca.training.styles import WHOLE, Mix
from vnca.training.terms import (
    AppearanceTerm,
    ConsistencyTerm,
    Iteration,
    OverflowTerm,
    SteadinessTerm,
    Term,
)


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
    """A rule in training on a scene and a style picture, or several of either.

    Every random choice comes from `config.seed`: same seed, same machine, same rule.

    Attributes:
        config: The hyperparameters.
        scenes: What is trained on, by turns.
        iteration: Iterations done.
        origins: What tells the weights that it began with, and theirs, from others.
        appearances: How far pictures are from each style picture.
        terms: Those of the loss, in the order in which they are asked.
        kept_states: How many states of a rollout are kept at a time, at most.
    """

    def __init__(
        self,
        scene: Scene[Any],
        rule: Rule,
        style: FloatArray | Sequence[FloatArray],
        config: TrainingConfig,
        network: FeatureNetwork,
        *,
        more_scenes: Sequence[Scene[Any]] = (),
        terms: Sequence[Term] = (),
        memory_budget: int | None = None,
    ) -> None:
        """Prepare training.

        Args:
            scene: What is trained on; its device is where is computed.
            rule: The rule to begin with.
            style: Linear RGB `[r, c, 3]`; one for each style of a rule that mixes several.
            config: The hyperparameters.
            network: The frozen network that judges pictures.
            more_scenes: Others that are trained on by turns with it, of the same width.
            terms: Further terms of the loss, beside appearance and overflow.
            memory_budget: Bytes that the program may take: rollouts keep as few states as that
                asks for, and compute the others again. The result is the same to the bit.

        Raises:
            OptionError: If the budget is not enough.
        """
        self.config, self.scenes = config, (scene, *more_scenes)
        self.iteration = 0
        self.origins: tuple[str, ...] = ()
        device = scene.priors.device
        self._rule = rule
        self._weights = Weights(
            *(
                torch.tensor(w, device=device, requires_grad=True)
                for w in (rule.hidden, rule.bias, rule.output)
            )
        )
        self._decoder = scene.decoder
        for tensor in self._decoder or ():
            tensor.requires_grad_()
        for other in more_scenes:
            other.decoder = self._decoder
        if scene.dimensions == 2:
            self._weights.hidden.register_hook(
                partial(_without_columns, columns=depth_columns(config.rule.channels))
            )
        if not scene.paints_density:
            self._weights.output.register_hook(_without_density)
            if self._decoder is not None:
                self._decoder.output.register_hook(_without_density)
                self._decoder.output_bias.register_hook(_without_density)
        self.appearances = tuple(
            AppearanceLoss(
                network,
                picture,
                config.appearance,
                config.pictures.size,
                scene.width,
                drawn=scene.decoder is not None,
            )
            for picture in ([style] if isinstance(style, np.ndarray) else style)
        )
        self._columns = rule.config.style_columns
        self._random = np.random.default_rng(config.seed)
        self._generator = torch.Generator().manual_seed(config.seed)
        own: list[Term] = [
            AppearanceTerm(self.appearances, self._generator),
            OverflowTerm(config.overflow),
        ]
        if config.steadiness:
            own.append(SteadinessTerm(config.steadiness))
        if config.consistency:
            own.append(ConsistencyTerm(config.consistency))
        self.terms = (*own, *terms)
        styles = len(self.appearances)
        self._grounds = [
            Ground.of(each, self._session(each), config, styles=styles, random=self._random)
            for each in self.scenes
        ]
        self._descent = self._fresh_descent()
        self._steps = 0  # of all rollouts: no two share a mask
        self._before: dict[str, Snapshot] | None = None  # the iteration that is under way
        self.kept_states = states_to_keep(self.scenes, config, memory_budget)

    @property
    def scene(self) -> Scene[Any]:
        """The first of those trained on, by which a rule is judged."""
        return self.scenes[0]

    @property
    def session(self) -> Session:
        """What computes the automaton on it; another that does the same may take its place."""
        return self._grounds[0].session

    @session.setter
    def session(self, session: Session) -> None:
        self._grounds[0].session = session

    def _session(self, scene: Scene[Any]) -> Session:
        """What computes the automaton on a scene, by the weights that are trained."""
        return open_session(
            replace(self._rule.automaton(self.config.seed), weights=self._weights),
            scene.domain,
            scene.priors,
            Compute(self.config.backend, str(scene.priors.device)),
            differentiable=True,
        )

    def begin_with(self, rule: Rule, origins: Sequence[str] = ()) -> None:
        """Take over the weights of a rule of the same shape, before the first iteration.

        Args:
            rule: The rule.
            origins: What it goes back to, as `vnca.rule.mixing.origins` tells.
        """
        self.origins = tuple(origins)
        decoder = rule.decoder.weights if rule.decoder is not None else ()
        arrays = (rule.hidden, rule.bias, rule.output, *decoder)
        with torch.no_grad():
            for ours, theirs in zip(self._trained, arrays, strict=True):
                ours.copy_(torch.from_numpy(theirs))
        self._descent = self._fresh_descent()

    @property
    def _trained(self) -> tuple[Tensor, ...]:
        """The weights of the automaton, then those of the decoder."""
        return (*self._weights, *(self._decoder or ()))

    def _fresh_descent(self) -> Descent:
        rates = Decoder.rates() if self._decoder is not None else ()
        return Descent(self._trained, [*(1.0 for _ in self._weights), *rates])

    @property
    def teaches_motion(self) -> bool:
        """Whether the rule learns to move as the smoke does."""
        return any(term.name == "motion" for term in self.terms)

    @property
    def background(self) -> Tensor:
        """Linear RGB `[3]` that pictures are composited over: the (first) style's mean colour."""
        return self.appearances[0].background

    @property
    def picture_cells(self) -> list[float]:
        """Cells along the shorter side of each style picture, as the rule is shown it."""
        return [one.style_scale * self.scene.width for one in self.appearances]

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
                f"training has diverged {MOST_ROLLBACKS + 1} times, the last at iteration "
                f"{self.iteration}, though the learning rate was halved each time; the weights of "
                f"iteration {self.good_iteration} are kept: choose a `learning_rate` far below "
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
            "origins": list(self.origins),
        }
        own = Snapshot({"generator": self._generator.get_state()}, values)
        parts = {name: part.snapshot() for name, part in self._parts().items()}
        return {"trainer": own, **{name: part for name, part in parts.items() if part}}

    def restore(self, snapshot: Mapping[str, Snapshot]) -> None:
        """Go on from a snapshot of a trainer that was made of the same inputs.

        Raises:
            KeyError, RuntimeError, TypeError, ValueError: If it is not one.
        """
        own = snapshot["trainer"]
        self.iteration = count(own.values["iteration"], "iteration", most=self.config.iterations)
        self._steps = count(own.values["steps"], "steps")
        self._random.bit_generator.state = own.values["random"]
        self.origins = tuple(map(str, own.values["origins"]))
        self._generator.set_state(own.tensors["generator"])
        for name, part in self._parts().items():
            if part.snapshot() is not None:
                part.restore(snapshot[name])
        self._before = None

    def _parts(self) -> dict[str, Pool | Descent | Term]:
        """What may remember something from one iteration to the next."""
        terms = {term.name: term for term in self.terms}
        first, *others = (ground.pool for ground in self._grounds)
        pools = {f"pool {number}": pool for number, pool in enumerate(others, 2)}
        return {"pool": first, **pools, "descent": self._descent, **terms}

    def _improve(self) -> Progress:
        config = self.config
        ground = self._grounds[self.iteration % len(self._grounds)]
        slot, life, age, before = ground.pool.draw(self.iteration // len(self._grounds))
        kept = before
        steps = int(self._random.integers(config.shortest_rollout, config.longest_rollout + 1))
        scene = ground.scene.augmented(life)
        if config.rule.transport and age:
            kept, before = scene.transported(before, self._random)
        judged = WHOLE
        mix = ground.lessons and ground.lessons.of(life, age)
        if mix is not None and self._columns is not None:
            scene, age = mix.asked(scene, self._columns), mix.age
        state = self._roll(ground, before, range(self._steps, self._steps + steps), scene)
        self._steps += steps
        viewpoint = scene.viewpoint(self._random)
        if mix is not None:
            judged = mix.judged(scene, viewpoint, self._random)
        background = self.appearances[judged.style].background
        pictures, opacity = scene.pictures(state, viewpoint, background)
        sums: dict[str, Tensor] = {}
        seen = Iteration(
            before=before,
            kept=kept,
            after=state,
            age=age,
            frames=steps / config.rule.steps_per_frame,
            scene=scene,
            viewpoint=viewpoint,
            pictures=pictures,
            opacity=opacity,
            background=background,
            judged=judged,
            sums=sums,
        )
        terms: dict[str, Tensor] = {}
        for term in self.terms:
            if found := term(seen):
                terms |= found
                sums[term.name] = torch.stack([*found.values()]).sum()
        first, *others = sums.values()
        loss = first + torch.stack(others).sum()
        is_sound = ground.pool.put(slot, state)
        rate = config.rate(self.iteration)
        self.iteration += 1
        went_on = self._descent.step(loss, rate, self.iteration, exploded=not is_sound)
        return Progress(
            iteration=self.iteration,
            loss=float(loss.detach()),
            terms={name: float(value.detach()) for name, value in terms.items()},
            exploded=not is_sound,
            diverged=not went_on,
        )

    def grow(self, steps: int, style: int = 0) -> Tensor:
        """A state grown from the seed, as painting does; no random stream moves."""
        ground, scene = self._grounds[0], self.scene
        if self._columns is not None:
            scene = Mix(style, style, 0.0, 0).asked(scene, self._columns)
        with torch.no_grad():
            return self._roll(ground, scene.seed(self.config.rule.channels), range(steps), scene)

    def _roll(self, ground: Ground, state: Tensor, steps: range, scene: Scene[Any]) -> Tensor:
        """The state after the numbered steps of the rule; differentiable in the weights."""
        session = ground.session.conditioned(scene.priors)
        return roll_out(session.step, state, steps, kept_states=self.kept_states)

    def rule(self) -> Rule:
        """The rule as it is now."""
        hidden, bias, output = map(_array, self._weights)
        decoder = self._decoder and Decoder(Decoded(*map(_array, self._decoder)))
        return replace(self._rule, hidden=hidden, bias=bias, output=output, decoder=decoder)


def _array(tensor: Tensor) -> FloatArray:
    return tensor.detach().cpu().numpy().copy()


def _without_columns(gradient: Tensor, columns: slice) -> Tensor:
    """The gradient of W1, without that of inputs that are always zero but for rounding."""
    gradient = gradient.clone()
    gradient[:, columns] = 0
    return gradient


def _without_density(gradient: Tensor) -> Tensor:
    """The gradient of what has a row for each output, without that of the density's."""
    gradient = gradient.clone()
    gradient[DENSITY_CHANGE] = 0
    return gradient
