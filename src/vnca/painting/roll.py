"""Rolling a rule over a sequence: state in, painting out, a frame at a time.

The state is anchored in a lattice and carried from frame to frame, while the cells that live
follow the smoke. Nothing but the state of the last frame is kept, so memory does not grow with
the length of a sequence.

Reference: VNCA section 3.4, "For inference, we apply N update steps …".
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from vnca.core.field import Field
from vnca.core.typing import Box, FloatArray, IntArray
from vnca.core.volume import Volume, dense, field_of
from vnca.engine.domain import Domain, DomainKind
from vnca.engine.session import Compute, open_session
from vnca.io.smoke_format import on_one_lattice
from vnca.io.velocity import extrapolated
from vnca.painting.config import StylizeConfig
from vnca.rule.conditioning import priors
from vnca.rule.paint import colours, density_factors
from vnca.rule.rule import SMOKE_THRESHOLD, Rule

UNPAINTED = 1.0
"""Linear colour of smoke far from all that the rule paints: white."""
COLOUR_DILATION = 3
"""How many cells beyond the living ones their colour goes on, so that faint smoke is no pale seam
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
        smoke: The frame as it was read.
        density: `[x, y, z]`, painted, in the units of the file; the array is made when it is asked
            for, as the smoke's is.
        colour: Likewise, linear RGB `[x, y, z, 3]`; beside the living cells continued from them,
            white farther away.
        state: What it leaves to the next frame.
    """

    smoke: Volume
    density: FloatArray
    colour: FloatArray
    state: RollState

    @classmethod
    def of_fields(
        cls, smoke: Volume, density: Field, colour: Field, state: RollState
    ) -> "Painting":
        """A painting given by where there is smoke and colour."""
        painted: Any = density
        coloured: Any = colour
        return cls(smoke, painted, coloured, state)

    @cached_property
    def density_field(self) -> Field:
        """The density where there is any."""
        return field_of(self, "density", self.smoke.origin)

    @cached_property
    def colour_field(self) -> Field:
        """The colour where it is not white."""
        return field_of(self, "colour", self.smoke.origin, outside=UNPAINTED)


@dataclass(frozen=True, eq=False)
class Roll:
    """A rule made ready for a sequence.

    Attributes:
        rule: The trained rule.
        config: How it is applied.
        box: Holds the smoke of all frames, in cells of the lattice that they share. Known from the
            files' headers before the first frame is read.
        compute: How steps are computed.
        colour_dilation: How many cells beyond the living ones their colour goes on.
    """

    rule: Rule
    config: StylizeConfig
    box: Box
    compute: Compute = field(default_factory=Compute)
    colour_dilation: int = COLOUR_DILATION

    @property
    def steps_per_frame(self) -> int:
        """Those asked for, or else those of training."""
        asked = self.config.steps_per_frame
        return self.rule.config.steps_per_frame if asked is None else asked

    @property
    def domain_kind(self) -> DomainKind:
        """Where cells live: as asked for, or else as in training."""
        return self.config.domain or self.rule.config.domain

    def refined(self, factor: int) -> "Roll":
        """The same on a grid `factor` times as fine along each axis, for smoke refined alike."""
        asked = self.config.steps_per_frame
        steps = None if asked is None else factor * asked
        return replace(
            self,
            rule=self.rule.refined(factor),
            config=replace(self.config, steps_per_frame=steps),
            box=self.box.refined(factor),
            colour_dilation=self.colour_dilation * factor,
        )

    def start(self) -> RollState:
        """The state before the first frame."""
        return RollState.empty(self.rule.config.channels)

    def paint(self, smoke: Volume, state: RollState) -> Painting:
        """The next frame, of the same lattice, from the state that the one before it left.

        A frame without smoke passes through. The painting starts afresh after it, unless cells
        live in the whole box.
        """
        return self._shown(smoke, self._stepped(smoke, state))

    def _stepped(self, smoke: Volume, state: RollState) -> RollState:
        """The state after the steps of a frame."""
        rule, config = self.rule, self.config
        domain = self._domain(smoke)
        if len(domain) == 0:
            return RollState.empty(rule.config.channels, state.steps_done)
        steps = self.steps_per_frame
        if len(state.cells) == 0:
            values, steps = domain.seed(rule.config.channels), config.warmup + steps
        else:
            values = Domain(state.cells, domain.box).carry(state.values, domain)
        told = priors(domain, smoke, rule)
        done = state.steps_done + steps
        session = open_session(rule.automaton(config.seed), domain, told, self.compute)
        uploaded = session.upload(values)
        values = session.read(session.run(uploaded, range(state.steps_done, done)))
        return RollState(domain.cells, values, done)

    def _shown(self, smoke: Volume, state: RollState) -> Painting:
        """The frame as a state shows it."""
        at, box = state.cells, smoke.box
        inside = ((at >= box.lower) & (at < box.upper)).all(axis=1)
        at, cells = at[inside], state.values[:-1][inside]
        painted = UNPAINTED + self.config.strength * (colours(cells) - UNPAINTED)
        colour = Field.from_cells(at, painted, box, outside=UNPAINTED)
        known = Field.from_cells(at, np.ones(len(at), bool), box, outside=False)
        colour, known = extrapolated(colour, known, self.colour_dilation)
        colour.values[~known.values] = UNPAINTED
        factors = Field.from_cells(
            at, density_factors(cells, strength=self.config.density_strength), box, outside=1.0
        )
        density = smoke.density_field
        density = replace(density, values=density.values * factors.blocks(density.bricks))
        return Painting.of_fields(smoke, density, replace(colour, outside=UNPAINTED), state)

    def _domain(self, smoke: Volume) -> Domain:
        """The cells that live in a frame."""
        if self.domain_kind == "box":
            return self._whole_box
        return Domain.around_smoke(
            smoke.density_field,
            threshold=SMOKE_THRESHOLD * self.rule.scales.density,
            reach=self.rule.config.reach,
            box=self.box.grown(self.rule.config.reach),
        )

    @cached_property
    def _whole_box(self) -> Domain:
        return Domain.filling(self.box.grown(self.rule.config.reach))


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
        painting = roll.paint(smoke.refined(refine), state)
        state = painting.state
        yield painting
