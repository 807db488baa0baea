"""Rolling a rule over a sequence: state in, painting out, a frame at a time.

The state is anchored in a lattice and carried from frame to frame, while the active cells follow
the smoke. Nothing but the state of the last frame is kept, so memory does not grow with the length
of a sequence.

Reference: VNCA section 3.4, "For inference, we apply N update steps …".
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.direction import NUMBERS, Carried, Direction, Inputs, Moment
from vnca.direction.carried import carry
from vnca.direction.colour import Editing
from vnca.direction.mixing import Answer, Parts, layered
from vnca.direction.values import Constant
from vnca.engine import Compute, Session, open_session
from vnca.engine.domain import Domain, DomainKind
from vnca.io.smoke_format import on_one_lattice
from vnca.painting.parts import parts_of
from vnca.painting.shown import COLOUR_DILATION, Painting, composed
from vnca.painting.state import Ready, RollState
from vnca.painting.transport import transported
from vnca.rule import SMOKE_THRESHOLD, Rule
from vnca.rule.conditioning import in_shares, priors
from vnca.rule.mixing import blended


@dataclass(frozen=True)
class StylizeConfig(Direction):
    """How a rule is rolled over a sequence, and how it shows."""

    warmup: int = 64
    """Steps on the first frame before it is painted."""
    domain: DomainKind | None = None
    """Which cells are active: those near the smoke (active) or all of its box; as in training
    unless given."""
    seed: int = 0
    """Same seed, same machine, same painting."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.warmup < 0:
            raise OptionError("`warmup` must not be negative")


@dataclass(frozen=True, eq=False)
class Roll:
    """A rule made ready for a sequence.

    Attributes:
        rule: The trained rule.
        config: How it is applied.
        box: Holds the smoke of all frames, in cells of their lattice; known from headers alone.
        compute: How steps are computed.
        colour_dilation: How many cells beyond the active ones their colour goes on.
        grid: How many times as fine as the grid of the smoke the automaton's is.
        finer: How many times as fine as the automaton's that of the painting, which it decodes.
        layers: The rules of further layers, in the order of `config.layers`.
        styles: Which of the rule's styles each value of `config.style_mix` is of.
        blend: The rules whose weights are mixed with its own, in the order of `config.blend`.
        inputs: What the direction of `config` takes beside the smoke.
        editing: What it does with colours as a whole.
        standing: Whether strokes of the style's picture are upright; guides turn them so.
    """

    rule: Rule
    config: StylizeConfig
    box: Box
    compute: Compute = field(default_factory=Compute)
    colour_dilation: int = COLOUR_DILATION
    grid: int = 1
    finer: int = 1
    layers: tuple["Roll", ...] = ()
    styles: tuple[int, ...] = ()
    blend: tuple[Rule, ...] = ()
    inputs: Inputs = field(default_factory=Inputs)
    editing: Editing = field(default_factory=Editing)
    standing: bool = False

    @property
    def steps_per_frame(self) -> int | str:
        """Those asked for, or else those of training; as text where they are no number."""
        asked = self.config.values["steps_per_frame"]
        if asked is None:
            return self.rule.config.steps_per_frame
        constant = isinstance(asked, Constant)
        return round(asked.number) * self.grid if constant else str(self.config.steps_per_frame)

    @property
    def beyond(self) -> int:
        """How many cells of the painting beyond the smoke's box there may be smoke."""
        return self.config.fluff * self.grid * self.finer

    @property
    def domain_kind(self) -> DomainKind:
        """Which cells are active: as asked for, or else as in training."""
        return self.config.domain or self.rule.config.domain

    def refined(self, factor: int) -> "Roll":
        """The same for paintings on a grid `factor` times as fine along each axis.

        A decoder is asked at so many more points; without one, the automaton runs on a grid as
        fine.
        """
        layers = tuple(layer.refined(factor) for layer in self.layers)
        if self.rule.decoder is not None:
            return replace(self, finer=factor * self.finer, layers=layers)
        return replace(
            self,
            rule=self.rule.refined(factor),
            box=self.box.refined(factor),
            colour_dilation=self.colour_dilation * factor,
            grid=self.grid * factor,
            layers=layers,
        )

    def start(self) -> RollState:
        """The state before the first frame."""
        layers = tuple(layer.start() for layer in self.layers)
        return replace(RollState.empty(self.rule.config.channels), layers=layers)

    def ready(self, smoke: Volume) -> Ready:
        """What painting a frame takes that does not wait for the frame before it.

        Args:
            smoke: On a grid as fine as the automaton's.

        Raises:
            GridError: If the smoke lacks what the rule is conditioned on.
        """
        domain = self.domain(smoke)
        rule = self.rule_of(smoke)
        layers = tuple(layer.ready(smoke) for layer in self.layers)
        if len(domain) == 0:
            return Ready(smoke, domain, None, rule, layers=layers)
        conditioning = priors(domain, smoke, rule)
        automaton = rule.automaton(self.config.seed).slowed(self.config.substeps)
        what = (automaton, domain, conditioning, self.compute)
        session = open_session(*what, steered=self.config.steers)
        return Ready(smoke, domain, session, rule, conditioning if self.styles else None, layers)

    def paint(self, smoke: Volume | Ready, state: RollState) -> Painting:
        """The next frame, of the same lattice, from the state that the one before it left.

        A frame without smoke passes through. The painting starts afresh after it, unless
        the whole box is active.

        Args:
            smoke: On a grid as fine as the automaton's; or what `ready` made of it.
            state: What the frame before it left.
        """
        _, show = self.stepped(smoke, state)
        del smoke  # what follows makes arrays of the same order
        return show()

    def stepped(
        self, smoke: Volume | Ready, state: RollState
    ) -> tuple[RollState, Callable[[], Painting]]:
        """What a frame leaves to the next; and what makes its painting, once, in any thread."""
        ready = smoke if isinstance(smoke, Ready) else self.ready(smoke)
        moment = self.moment(ready.smoke, state.carried)
        rolls, each, states = (self, *self.layers), (ready, *ready.layers), (state, *state.layers)
        parts = zip(rolls, each, states, strict=True)
        left, *layers = (roll._advanced(on, before, moment) for roll, on, before in parts)
        state = replace(left, layers=tuple(layers), carried=moment.carried)
        # To show a state takes as much memory again as a session holds.
        shown = [on._replace(session=None, conditioning=None, layers=()) for on in each]

        def show() -> Painting:
            parts = self.seen(shown, (left, *layers), moment)
            shown.clear()
            return self.painting(moment, parts, state)

        return state, show

    def rule_of(self, smoke: Volume) -> Rule:
        """The rule with the weights of a frame."""
        if not self.blend:
            return self.rule
        moment, count = Moment(smoke, self.box, inputs=self.inputs), len(self.blend) + 1
        nowhere = np.zeros((1, 3), np.int32)
        shares = self.config.mix("blend", range(1, count), count, moment, nowhere)
        return blended((self.rule, *self.blend), shares)

    def passed(
        self, smoke: Volume | Ready, state: RollState, at: Moment | None = None
    ) -> RollState:
        """What a frame leaves to the next, unpainted; see `paint`."""
        ready = smoke if isinstance(smoke, Ready) else self.ready(smoke)
        moment = at or self.moment(ready.smoke, state.carried)
        each = zip(self.layers, ready.layers, state.layers, strict=True)
        layers = tuple(layer.passed(on, left, moment) for layer, on, left in each)
        return replace(self._advanced(ready, state, moment), carried=moment.carried, layers=layers)

    def moment(self, smoke: Volume, carried: Carried | None) -> Moment:
        """A frame as the direction is asked about it, and what smoke carried to it."""
        moment = self.moment_of(smoke)
        return replace(moment, carried=carry(carried, self.config.parts(), moment))

    def moment_of(self, smoke: Volume) -> Moment:
        """The same with nothing carried."""
        threshold = SMOKE_THRESHOLD * self.rule.scales.density
        return Moment(smoke, self.box, threshold, self.grid, self.inputs)

    def told(self, ready: Ready, moment: Moment) -> FloatArray:
        """What the cells of a frame are conditioned on, `[n, P]`, styles as they are mixed."""
        given = ready.conditioning
        if given is None:
            given = priors(ready.domain, ready.smoke, ready.rule)
        if not self.styles:
            return given
        count = self.rule.config.style_count
        shares = self.config.mix("style_mix", self.styles, count, moment, ready.domain.cells)
        return in_shares(given, self.rule, shares)

    def seen(self, ready: Sequence[Ready], states: Sequence[RollState], moment: Moment) -> Parts:
        """What is painted, layers over each other.

        Args:
            ready: What this rule takes, and what those of its layers do.
            states: Their states.
            moment: The frame.
        """
        parts, *above = (
            roll._parts(each, state, moment)
            for roll, each, state in zip((self, *self.layers), ready, states, strict=True)
        )
        for number, layer in enumerate(above):
            share = self.config.share(number, moment, self._places(parts.at))
            parts = layered(parts, layer, share)
        return parts

    def _advanced(self, ready: Ready, state: RollState, moment: Moment) -> RollState:
        """The state of this rule alone after the steps of a frame."""
        domain, session = ready.domain, ready.session
        if session is None:
            return RollState.empty(self.rule.config.channels, state.steps_done)
        if self.styles:
            session = session.conditioned(self.told(ready, moment))
        steering = self.config.steering(moment, domain.cells, self.standing)
        session = session if steering is None else session.steered(steering)
        warmup = self.config.warmup if len(state.cells) == 0 else 0
        warmup *= self.config.substeps
        done = state.steps_done + warmup
        steps = self.steps(moment, domain)
        fewest, most = int(np.min(steps)), int(np.max(steps))
        # What they begin with has no name here, or it would be kept to the last step.
        values = session.run(
            session.upload(self.begun(ready, state, moment)),
            range(state.steps_done, done + fewest),
        )
        for step in range(fewest, most):
            values = with_rest(session, values, done + step, rest=np.asarray(steps) <= step)
        return RollState(domain.cells, session.read(values), done + most, ready.smoke.frame)

    def steps(self, moment: Moment, domain: Domain) -> AnyArray | int:
        """How many steps the cells do, all as many or each its own, `[n]`."""
        if self.config.steps_per_frame is None:
            return self.rule.config.steps_per_frame * self.config.substeps
        asked: Answer = self.config.value("steps_per_frame", moment, domain.cells)
        return np.rint(asked).astype(int) * self.grid * self.config.substeps

    def begun(self, ready: Ready, state: RollState, moment: Moment) -> FloatArray:
        """What the cells of a frame begin with, of the state that the one before it left."""
        smoke, domain = ready.smoke, ready.domain
        if len(state.cells) == 0:
            return domain.seed(self.rule.config.channels)
        before, velocity = Domain(state.cells, domain.box), smoke.velocity_field
        speed = self.pattern_speed(moment, domain)
        if velocity is None or not np.any(speed):
            return before.carry(state.values, domain)
        frames = 1 if state.frame is None else max(1, smoke.frame - state.frame)
        return transported(
            state.values, before, domain, velocity, speed * frames, threads=self.compute.threads
        )

    @property
    def fastest(self) -> float:
        """How many times as fast as the velocity the pattern is carried, at most."""
        if self.config.pattern_speed is None:
            return float(self.rule.config.transport)
        asked = self.config.values["pattern_speed"]
        return abs(asked.number) if isinstance(asked, Constant) else NUMBERS["pattern_speed"].high

    def pattern_speed(self, moment: Moment, domain: Domain) -> Answer:
        """How fast the velocity carries the pattern, everywhere or in each cell, `[n]`."""
        if self.config.pattern_speed is None:
            return float(self.rule.config.transport)
        return self.config.value("pattern_speed", moment, domain.cells)

    def _places(self, at: AnyArray) -> AnyArray:
        """Where points of the grid of the painting lie, in index coordinates of the automaton's.

        As they are where nobody looks.
        """
        if self.finer == 1 or not self.config.asks_for_places:
            return at
        return (at + 0.5) / self.finer - 0.5

    def painting(
        self, moment: Moment, parts: Parts, state: Any, mass: tuple[float, float] | None = None
    ) -> Painting:
        """The frame as a state shows it, on the grid of the painting.

        Args:
            moment: The frame.
            parts: What is painted.
            state: What is left to the next.
            mass: As of `composed`.
        """
        smoke = moment.smoke.refined(self.finer)
        if self.config.fluff and not smoke.box.is_empty:
            smoke = smoke.within(smoke.box.grown(self.beyond))
        reach = self.colour_dilation * self.finer
        density, colour, light = composed(
            smoke, parts, self.config, moment, self._places, self.editing, reach=reach, mass=mass
        )
        return Painting.of_fields(smoke, density, colour, state, moment.smoke, light)

    def _parts(self, ready: Ready, state: RollState, moment: Moment) -> Parts:
        """What is painted by this rule alone."""

        def strength(at: AnyArray) -> Answer:
            return self.config.value("density_strength", moment, self._places(at))

        return parts_of(state, ready, self.finer, strength, self.compute)

    @property
    def reached(self) -> Box:
        """The cells that may ever be active."""
        return self.box.grown(self.rule.config.dilation)

    def domain(self, smoke: Volume, tile: Box | None = None) -> Domain:
        """The active cells of a frame; those in a tile, if one is given."""
        if self.domain_kind == "box":
            if tile is None:
                return self._whole_box
            Domain.require_fillable(self.reached)
            return replace(Domain.filling(self.reached.intersection(tile)), box=self.reached)
        domain = Domain.around_smoke(
            smoke.density_field,
            threshold=SMOKE_THRESHOLD * self.rule.scales.density,
            dilation=self.rule.config.dilation,
            box=self.reached,
        )
        return domain if tile is None else domain.within(tile)

    @cached_property
    def _whole_box(self) -> Domain:
        return Domain.filling(self.reached)


def with_rest(session: Session, values: Any, number: int, *, rest: AnyArray) -> Any:
    """A state after a step in which some cells do nothing, `[n]` of them or all."""
    before = session.read(values).copy()
    after = session.read(session.run(values, range(number, number + 1))).copy()
    after[:-1][rest] = before[:-1][rest]
    return session.upload(after)


def painted(frames: Iterable[Volume], roll: Roll) -> Iterator[Painting]:
    """Paint a sequence frame by frame, on the lattice of the first that has smoke.

    Raises:
        GridError: If its cells are not cubic, or a frame can have no place on them.
    """
    state = roll.start()
    for smoke in on_one_lattice(frames):
        painting = roll.paint(smoke.refined(roll.grid), state)
        state = painting.state
        yield painting


def stylize(
    frames: Iterable[Volume],
    rule: Rule,
    config: StylizeConfig,
    *,
    box: Box,
    refine: int = 1,
    compute: Compute | None = None,
) -> Iterator[Painting]:
    """Paint a sequence frame by frame, reading one at a time.

    All are painted on the lattice of the first that has smoke, in whose cells the box is, `refine`
    times as fine. See `Roll` for the other arguments.

    Raises:
        GridError: If its cells are not cubic, or a frame can have no place on them.
    """
    return painted(frames, Roll(rule, config, box, compute or Compute()).refined(refine))
