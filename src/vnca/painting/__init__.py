"""Rolling a rule over a sequence: state in, painting out, a frame at a time.

The state is anchored in a lattice and carried from frame to frame, while the active cells follow
the smoke. Nothing but the state of the last frame is kept, so memory does not grow with the length
of a sequence.

Reference: VNCA section 3.4, "For inference, we apply N update steps …".
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vnca.core import Box, FloatArray, IntArray
from vnca.core.errors import OptionError
from vnca.core.field import Field
from vnca.core.volume import Volume, dense, field_of
from vnca.engine import Compute, Session, open_session
from vnca.engine.domain import Domain, DomainKind
from vnca.io.smoke_format import on_one_lattice
from vnca.io.velocity import extrapolated
from vnca.rule import SMOKE_THRESHOLD, Rule
from vnca.rule.conditioning import priors
from vnca.rule.paint import (
    Between,
    colour_means,
    colours,
    density_factors,
    density_means,
    parts_of_cells,
)


@dataclass(frozen=True)
class StylizeConfig:
    """How a rule is rolled over a sequence, and how strongly it shows."""

    steps_per_frame: int | None = None
    """Steps of the automaton between two frames; as many as in training unless given. On a grid K
    times as fine they are K times as many, given or not."""
    warmup: int = 64
    """Steps on the first frame before it is painted."""
    domain: DomainKind | None = None
    """Which cells are active: those near the smoke (active) or all of its box; as in training
    unless given."""
    strength: float = 1.0
    """Colour of the painting, from 0 (white smoke) to 1."""
    density_strength: float = 1.0
    """How much the painting changes the density, from 0 (not at all) to 1."""
    seed: int = 0
    """Same seed, same machine, same painting."""

    def __post_init__(self) -> None:
        if self.warmup < 0 or (self.steps_per_frame is not None and self.steps_per_frame < 0):
            raise OptionError("`steps_per_frame` and `warmup` must not be negative")
        for name in ("strength", "density_strength"):
            if not 0 <= getattr(self, name) <= 1:
                raise OptionError(f"`{name}` {getattr(self, name)}: must be from 0 to 1")


UNPAINTED = 1.0
"""Linear colour of smoke far from all that the rule paints: white."""
COLOUR_DILATION = 3
"""How many cells beyond the active ones their colour goes on, so that faint smoke is no pale seam
where a renderer interpolates it."""


@dataclass(frozen=True, eq=False)
class RollState:
    """What a frame leaves to the next: all it takes to go on from there.

    Attributes:
        cells: `[n, 3]` index coordinates, in the lattice, of the cells alive; none before the
            first frame and after one without smoke.
        values: `[n + 1, C]`, their state and a last row of zeros.
        steps_done: Steps since the sequence began, by which the next ones are numbered.
    """

    cells: IntArray
    values: FloatArray
    steps_done: int = 0

    @classmethod
    def empty(cls, channels: int, steps_done: int = 0) -> "RollState":
        """That of nothing painted yet."""
        cells = np.zeros((0, 3), dtype=np.int32)
        return cls(cells, np.zeros((1, channels), dtype=np.float32), steps_done)


@dense("density", "colour", what=lambda painting: f"frame {painting.smoke.frame}")
@dataclass(frozen=True, eq=False)
class Painting:
    """One painted frame, on the same cells as its smoke.

    Attributes:
        smoke: The frame as it was read, on the grid of the painting.
        density: `[x, y, z]`, painted, in the units of the file; the array is made when it is asked
            for, as the smoke's is.
        colour: Likewise, linear RGB `[x, y, z, 3]`; beside the active cells continued from them,
            white farther away.
        state: What it leaves to the next frame.
        coarse: The frame on the grid of the automaton; None where that is not known.
    """

    smoke: Volume
    density: FloatArray
    colour: FloatArray
    state: RollState
    coarse: Volume | None = None

    @classmethod
    def of_fields(
        cls, smoke: Volume, density: Field, colour: Field, state: RollState, coarse: Volume
    ) -> "Painting":
        """A painting given by where there is smoke and colour."""
        painted: Any = density
        coloured: Any = colour
        return cls(smoke, painted, coloured, state, coarse)

    @cached_property
    def density_field(self) -> Field:
        """The density where there is any."""
        return field_of(self, "density", self.smoke.origin)

    @cached_property
    def colour_field(self) -> Field:
        """The colour where it is not white."""
        return field_of(self, "colour", self.smoke.origin, outside=UNPAINTED)


class _Parts(NamedTuple):
    """What is painted: cells `[m, 3]`, their linear RGB `[m, 3]`, factors `[m]` of density."""

    at: IntArray
    colour: FloatArray
    factors: FloatArray


class Ready(NamedTuple):
    """A frame, with all that painting it takes beside what the frame before it left.

    Attributes:
        smoke: On a grid as fine as the automaton's.
        domain: Its active cells.
        session: The automaton on them; None if there are none.
    """

    smoke: Volume
    domain: Domain
    session: Session | None

    @property
    def frame(self) -> int:
        """Its number in the sequence."""
        return self.smoke.frame


@dataclass(frozen=True, eq=False)
class Roll:
    """A rule made ready for a sequence.

    Attributes:
        rule: The trained rule.
        config: How it is applied.
        box: Holds the smoke of all frames, in cells of the lattice that they share. Known from the
            files' headers before the first frame is read.
        compute: How steps are computed.
        colour_dilation: How many cells beyond the active ones their colour goes on.
        grid: How many times as fine as the grid of the smoke the automaton's is.
        finer: How many times as fine as the automaton's the grid of the painting is; what is there
            between the cells, the decoder says.
    """

    rule: Rule
    config: StylizeConfig
    box: Box
    compute: Compute = field(default_factory=Compute)
    colour_dilation: int = COLOUR_DILATION
    grid: int = 1
    finer: int = 1

    @property
    def steps_per_frame(self) -> int:
        """Those asked for, or else those of training."""
        asked = self.config.steps_per_frame
        return self.rule.config.steps_per_frame if asked is None else asked

    @property
    def domain_kind(self) -> DomainKind:
        """Which cells are active: as asked for, or else as in training."""
        return self.config.domain or self.rule.config.domain

    def refined(self, factor: int) -> "Roll":
        """The same for paintings on a grid `factor` times as fine along each axis.

        A decoder is asked at so many more points; without one, the automaton runs on a grid as
        fine.
        """
        if self.rule.decoder is not None:
            return replace(self, finer=factor * self.finer)
        asked = self.config.steps_per_frame
        steps = None if asked is None else factor * asked
        return replace(
            self,
            rule=self.rule.refined(factor),
            config=replace(self.config, steps_per_frame=steps),
            box=self.box.refined(factor),
            colour_dilation=self.colour_dilation * factor,
            grid=self.grid * factor,
        )

    def start(self) -> RollState:
        """The state before the first frame."""
        return RollState.empty(self.rule.config.channels)

    def ready(self, smoke: Volume) -> Ready:
        """What painting a frame takes that does not wait for the frame before it.

        Args:
            smoke: On a grid as fine as the automaton's.

        Raises:
            GridError: If the smoke lacks what the rule is conditioned on.
        """
        domain = self._domain(smoke)
        if len(domain) == 0:
            return Ready(smoke, domain, None)
        conditioning = priors(domain, smoke, self.rule)
        automaton = self.rule.automaton(self.config.seed)
        return Ready(smoke, domain, open_session(automaton, domain, conditioning, self.compute))

    def paint(self, smoke: Volume | Ready, state: RollState) -> Painting:
        """The next frame, of the same lattice, from the state that the one before it left.

        A frame without smoke passes through. The painting starts afresh after it, unless
        the whole box is active.

        Args:
            smoke: On a grid as fine as the automaton's; or what `ready` made of it.
            state: What the frame before it left.
        """
        ready = smoke if isinstance(smoke, Ready) else self.ready(smoke)
        state = self._stepped(ready, state)
        parts, coarse = self._parts(ready.domain, state), ready.smoke
        del ready, smoke  # what follows makes arrays of the same order
        return self._shown(coarse, parts, state)

    def _stepped(self, ready: Ready, state: RollState) -> RollState:
        """The state after the steps of a frame."""
        domain, session = ready.domain, ready.session
        if session is None:
            return RollState.empty(self.rule.config.channels, state.steps_done)
        warmup = self.config.warmup if len(state.cells) == 0 else 0
        done = state.steps_done + warmup + self.steps_per_frame
        # What they begin with has no name here, or it would be kept to the last step.
        values = session.run(
            session.upload(self._begun(domain, state)), range(state.steps_done, done)
        )
        return RollState(domain.cells, session.read(values), done)

    def _begun(self, domain: Domain, state: RollState) -> FloatArray:
        """What the cells of a frame begin with, of the state that the one before it left."""
        if len(state.cells) == 0:
            return domain.seed(self.rule.config.channels)
        return Domain(state.cells, domain.box).carry(state.values, domain)

    def _shown(self, coarse: Volume, parts: _Parts, state: RollState) -> Painting:
        """The frame as a state shows it, on the grid of the painting."""
        smoke = coarse.refined(self.finer)
        box = smoke.box
        inside = ((parts.at >= box.lower) & (parts.at < box.upper)).all(axis=1)
        at, colour, factors = parts.at[inside], parts.colour[inside], parts.factors[inside]
        painted = UNPAINTED + self.config.strength * (colour - UNPAINTED)
        colour = Field.from_cells(at, painted, box, outside=UNPAINTED)
        known = Field.from_cells(at, np.ones(len(at), bool), box, outside=False)
        colour, known = extrapolated(colour, known, self.colour_dilation * self.finer)
        colour.values[~known.values] = UNPAINTED
        factors = Field.from_cells(at, factors, box, outside=1.0)
        density = smoke.density_field
        density = replace(density, values=density.values * factors.blocks(density.bricks))
        colour = replace(colour, outside=UNPAINTED)
        return Painting.of_fields(smoke, density, colour, state, coarse)

    def _parts(self, domain: Domain, state: RollState) -> _Parts:
        """What is painted.

        Of a decoder, each is the mean over a part of a cell: what is finer than the grid of the
        painting would be grain on it.
        """
        strength = self.config.density_strength
        if self.rule.decoder is None:
            cells = state.values[:-1]
            factors = density_factors(cells, strength=strength)
            return _Parts(state.cells, colours(cells), factors)
        between = Between(self.rule, self.compute.backend, threads=self.compute.threads)
        parts = self.finer
        colour = np.empty((len(domain), *3 * (parts,), 3), np.float32)
        factors = np.empty(colour.shape[:-1], np.float32)
        for some, seen in parts_of_cells(between, state.values, domain, parts):
            colour[some] = colour_means(seen)
            factors[some] = density_means(seen, strength=strength)
        offsets = np.indices(3 * (parts,), np.int32).reshape(3, -1).T
        at = (state.cells[:, None] * parts + offsets).reshape(-1, 3)
        at = at.astype(np.int32, copy=False)
        return _Parts(at, colour.reshape(-1, 3), factors.reshape(-1))

    def _domain(self, smoke: Volume) -> Domain:
        """The active cells of a frame."""
        if self.domain_kind == "box":
            return self._whole_box
        return Domain.around_smoke(
            smoke.density_field,
            threshold=SMOKE_THRESHOLD * self.rule.scales.density,
            dilation=self.rule.config.dilation,
            box=self.box.grown(self.rule.config.dilation),
        )

    @cached_property
    def _whole_box(self) -> Domain:
        return Domain.filling(self.box.grown(self.rule.config.dilation))


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

    All are painted on the lattice of the first that has smoke, in whose cells the box is.

    See `Roll` for the other arguments; `refine` times as fine as the smoke's is the grid of the
    paintings.

    Raises:
        GridError: If its cells are not cubic, or a frame can have no place on them.
    """
    roll = Roll(rule, config, box, compute or Compute()).refined(refine)
    state = roll.start()
    for smoke in on_one_lattice(frames):
        painting = roll.paint(smoke.refined(roll.grid), state)
        state = painting.state
        yield painting
