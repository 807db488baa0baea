"""Rolling rules over frames tile by tile: the bits of `Roll`, in the memory of a tile.

The mask is a hash of a cell's coordinates and a step sees one cell far, so a tile with K cells
around it can do K steps by itself; then those around it are fetched anew.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, Box, FloatArray, IntArray
from vnca.core.bricks import meeting
from vnca.core.volume import Volume
from vnca.direction import Carried, Moment
from vnca.direction.moment import DEEPEST, HIGHEST
from vnca.direction.silhouette import masses, total
from vnca.engine import open_session
from vnca.engine.domain import Domain
from vnca.io.painted.parts import tiles_of
from vnca.io.parts import SmokeParts
from vnca.painting import Painting, Ready, Roll, RollState, with_rest
from vnca.painting.frames import read_ahead
from vnca.painting.tiles import Tiling
from vnca.painting.tiles.halo import likely_halo
from vnca.painting.tiles.kept import Keeping, Kept
from vnca.painting.tiles.state import TiledState
from vnca.rule import Rule

_BESIDE = 2
"""Cells around that interpolation takes."""


class _Begun(NamedTuple):
    """What the cells of a frame begin with.

    Attributes:
        rule: With the weights of the frame.
        values: Their state.
        told: What they are conditioned on, and in a last column how many steps each does.
        most: The most steps that one does.
    """

    rule: Rule
    values: Kept
    told: Kept
    most: int


@dataclass(frozen=True, eq=False)
class TiledRoll:
    """A rule made ready for a sequence that is painted tile by tile.

    Attributes:
        roll: The rule.
        tiling: How frames are cut.
        folder: Where scratch files are.
        tell: Is told what is being done.
    """

    roll: Roll
    tiling: Tiling
    folder: Path
    tell: Callable[[str], None]
    _halos: dict[int, int] = field(default_factory=dict, init=False)

    @property
    def rolls(self) -> tuple[Roll, ...]:
        """The rule, and those of further layers."""
        return (self.roll, *self.roll.layers)

    def start(self) -> TiledState:
        """The state before the first frame."""
        first, *layers = (TiledState(roll.rule.config.channels) for roll in self.rolls)
        return replace(first, layers=tuple(layers))

    def advance(self, smoke: SmokeParts, state: TiledState) -> TiledState:
        """The state after the steps of a frame, as those of `Roll.paint` lead to.

        Raises:
            FileFormatError: If the file is corrupt.
            GridError: If the smoke lacks what is asked for.
            OutputError: If there is no room for scratch files.
        """
        before = (state, *state.layers)
        begun, carried = self._begin(smoke, before)
        left = []
        for roll, each, was in zip(self.rolls, begun, before, strict=True):
            if each is None:
                left.append(TiledState(was.channels, steps_done=was.steps_done))
                continue
            warmup = roll.config.warmup if len(was) == 0 else 0
            numbers = range(was.steps_done, was.steps_done + warmup + each.most)
            kept = self._stepped(roll, each, numbers, rest_from=was.steps_done + warmup)
            left.append(TiledState(was.channels, kept, numbers.stop, smoke.frame))
        return replace(left[0], carried=carried, layers=tuple(left[1:]))

    def painting(
        self,
        smoke: SmokeParts,
        state: TiledState,
        box: Box,
        mass: tuple[float, float] | None = None,
    ) -> Painting:
        """A frame as a state shows it, right in a box of the painting's cells and none other.

        Args:
            smoke: The frame.
            state: After its steps.
            box: The cells.
            mass: The smoke of the frame in all, as painted and before, where it is to be kept.
        """
        roll = self.roll
        moved = roll.config.fluff * roll.grid
        inner = box.coarsened(roll.finer).grown(roll.colour_dilation + moved + 2 * _BESIDE)
        aimed = roll.config.asks_for_places
        part = self._part(smoke, inner.grown(self._sight + _BESIDE), motion=aimed)
        moment = replace(roll.moment_of(part), carried=state.carried)
        ready, states = [], []
        for each, left in zip(self.rolls, (state, *state.layers), strict=True):
            local = _local(left, inner)
            domain = Domain(local.cells, each.reached)
            ready.append(Ready(part, domain, None, each.rule_of(part)))
            states.append(local)
        return roll.painting(moment, roll.seen(ready, states, moment), state, mass or (1.0, 1.0))

    def mass(self, smoke: SmokeParts, state: TiledState) -> tuple[float, float] | None:
        """How much smoke a frame has in all, as it is painted and before, where that matters."""
        roll = self.roll
        if not roll.config.keep_mass:
            return None
        box = smoke.box.refined(roll.grid * roll.finer).grown(roll.beyond)
        now, was = [np.zeros(0)], [np.zeros(0)]
        for tile in tiles_of(box, self.tiling.edge * roll.finer):
            painting = self.painting(smoke, state, tile)
            now.append(masses(painting.density_field.within(tile)))
            was.append(masses(painting.smoke.density_field.within(tile)))
        return total(np.concatenate(now)), total(np.concatenate(was))

    @property
    def _sight(self) -> int:
        """How many cells far what is asked of a place may depend on the smoke."""
        asks = self.roll.config.asks_for_places
        return (DEEPEST + HIGHEST + _BESIDE) * self.roll.grid if asks else 0

    def _part(self, smoke: SmokeParts, box: Box, *, motion: bool = True) -> Volume:
        """What is in a box of the automaton's cells."""
        grid = self.roll.grid
        coarse = box.coarsened(grid).grown(1 if grid > 1 else 0)
        return smoke.part(coarse, motion=motion).refined(grid)

    def _tiles(self, smoke: SmokeParts) -> list[Box]:
        """Those in which cells may be active."""
        reach = max(roll.rule.config.dilation for roll in self.rolls)
        if any(roll.domain_kind == "box" for roll in self.rolls):
            box = self.roll.box.grown(reach)
            return list(tiles_of(box, self.tiling.edge))
        grid = self.roll.grid
        tiles = tiles_of(smoke.box.refined(grid).grown(reach), self.tiling.edge)
        return [tile for tile in tiles if smoke.holds(tile.grown(reach).coarsened(grid).grown(1))]

    def _begin(
        self, smoke: SmokeParts, before: Sequence[TiledState]
    ) -> tuple[list[_Begun | None], Carried | None]:
        """What cells begin with under each rule, None of no cells; and what is carried along."""
        tiles = self._tiles(smoke)
        keeping = [
            (Keeping(self.folder, channels), Keeping(self.folder, width + 1))
            for channels, width in (
                (roll.rule.config.channels, roll.rule.config.conditioning_width)
                for roll in self.rolls
            )
        ]
        most = [0] * len(self.rolls)
        rules = [roll.rule for roll in self.rolls]
        carried: list[Carried] = []
        margin = max(roll.rule.config.dilation for roll in self.rolls) + self._sight + _BESIDE
        parts = read_ahead(partial(self._part, smoke, tile.grown(margin)) for tile in tiles)
        for number, (tile, part) in enumerate(zip(tiles, parts, strict=True), 1):
            while (wanted := self._motion(part, tile, before)) > margin:
                margin = wanted
                part = self._part(smoke, tile.grown(margin))
            moment = self.roll.moment(part, before[0].carried)
            if moment.carried is not None:
                carried.append(_carried_in(moment.carried, tile))
            for at, (roll, was) in enumerate(zip(self.rolls, before, strict=True)):
                domain = roll.domain(part, tile)
                if len(domain) == 0:
                    continue
                rules[at] = roll.rule_of(part)
                steps = np.broadcast_to(roll.steps(moment, domain), len(domain))
                most[at] = max(most[at], int(steps.max()))
                ready = Ready(part, domain, None, rules[at])
                local = _local(was, _upstream(roll, ready, was, moment))
                values, told = keeping[at]
                values.add(domain.cells, roll.begun(ready, local, moment)[:-1])
                given = roll.told(ready, moment)
                column = steps[:, None].astype(np.float32)
                told.add(domain.cells, np.concatenate([given, column], axis=1))
            self.tell(f"frame {smoke.frame}: tile {number} of {len(tiles)} begun")
        smoke.require()
        begun = [
            _Begun(rule, values.kept(), told.kept(), steps)
            for rule, (values, told), steps in zip(rules, keeping, most, strict=True)
        ]
        return [each if len(each.values) else None for each in begun], _joined(carried)

    def _motion(self, part: Volume, tile: Box, before: Sequence[TiledState]) -> int:
        """How far around a tile velocity has to be known to see where smoke came from."""
        velocity = part.velocity_field
        if velocity is None:
            return 0
        near = velocity.values[meeting(velocity.bricks, tile.grown(_BESIDE))]
        fastest = float(np.abs(near).max(initial=0))
        times = [1.0]
        for roll, was in zip(self.rolls, before, strict=True):
            times.append(roll.fastest * _frames(was, part))
        widest = max(self.roll.reached.shape)
        return min(math.ceil(0.5 * fastest * max(times)) + 2 * _BESIDE, widest + self.tiling.edge)

    def _stepped(self, roll: Roll, begun: _Begun, numbers: range, *, rest_from: int) -> Kept:
        """The state after the steps of some numbers; from one of them on, cells may rest."""
        state, told = begun.values, begun.told
        if not numbers:
            return state
        tiles = [box for box in tiles_of(roll.reached, self.tiling.edge) if state.holds(box)]
        halo = self.tiling.halo or self._halos.get(len(numbers))
        if halo is None:
            halo = self._halos[len(numbers)] = likely_halo(state, tiles, len(numbers))
        rounds = max(1, -(-len(numbers) // halo))
        ends = [numbers.start + len(numbers) * end // rounds for end in range(rounds + 1)]
        for begin, end in pairwise(ends):
            after = Keeping(self.folder, roll.rule.config.channels)
            for number, tile in enumerate(tiles, 1):
                given = state, told, tile, range(begin, end), rest_from
                after.add(*self._block(roll, begun.rule, *given))
                self.tell(f"step {end - numbers.start} of {len(numbers)}, tile {number}")
            state = after.kept()
        return state

    def _block(
        self,
        roll: Roll,
        rule: Rule,
        state: Kept,
        told: Kept,
        tile: Box,
        numbers: range,
        rest_from: int,
    ) -> tuple[IntArray, FloatArray]:
        """The cells of a tile and their values after some steps."""
        box = tile.grown(len(numbers))
        cells, values = state.within(box)
        domain = Domain(cells, roll.reached)
        given = told.within(box)[1]
        steps = given[:, -1]
        session = open_session(
            *(rule.automaton(roll.config.seed), domain),
            np.ascontiguousarray(given[:, :-1]),
            roll.compute,
        )
        fewest = rest_from + int(steps.min(initial=len(numbers)))
        together = range(numbers.start, max(numbers.start, min(numbers.stop, fewest)))
        begun = [_with_outside(values)]
        del values  # nor has what they begin with a name, or it would be kept to the last step
        stepped = session.run(session.upload(begun.pop()), together)
        for number in range(together.stop, numbers.stop):
            stepped = with_rest(session, stepped, number, rest=steps <= number - rest_from)
        inside = _in(cells, tile)
        return cells[inside], session.read(stepped)[:-1][inside]


def _upstream(roll: Roll, ready: Ready, was: TiledState, moment: Moment) -> Box:
    """The cells from which those of a tile may have their state."""
    low = ready.domain.cells.min(axis=0).astype(float)
    high = ready.domain.cells.max(axis=0) + 1.0
    velocity = ready.smoke.velocity_field
    if velocity is not None and len(was):
        speed = roll.pattern_speed(moment, ready.domain)
        times = np.array([[np.min(speed)], [np.max(speed)]], float) * _frames(was, ready.smoke)
        moving = velocity.values.reshape(-1, 3)
        ends = [moving.min(axis=0, initial=0), moving.max(axis=0, initial=0)]
        moved = np.concatenate([times * end for end in ends])
        low -= np.maximum(moved.max(axis=0), 0)
        high -= np.minimum(moved.min(axis=0), 0)
    lower = np.maximum(np.floor(low) - _BESIDE, roll.reached.lower).astype(int).tolist()
    upper = np.minimum(np.ceil(high) + _BESIDE, roll.reached.upper).astype(int).tolist()
    return Box((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


def _frames(was: TiledState, smoke: Volume) -> int:
    """For how many frames smoke has moved since a state."""
    return 1 if was.frame is None else max(1, smoke.frame - was.frame)


def _local(state: TiledState, box: Box) -> RollState:
    """A state in a box."""
    if state.kept is None:
        return replace(RollState.empty(state.channels, state.steps_done), frame=state.frame)
    cells, values = state.kept.within(box)
    return RollState(cells, _with_outside(values), state.steps_done, state.frame)


def _with_outside(values: FloatArray) -> FloatArray:
    return np.concatenate([values, np.zeros((1, values.shape[1]), values.dtype)])


def _in(cells: AnyArray, box: Box) -> AnyArray:
    return np.asarray(((cells >= box.lower) & (cells < box.upper)).all(axis=1))


def _carried_in(carried: Carried, box: Box) -> Carried:
    own = _in(carried.cells, box)
    return Carried(carried.cells[own], {n: values[own] for n, values in carried.values.items()})


def _joined(parts: Sequence[Carried]) -> Carried | None:
    """What is carried in all tiles."""
    if not parts:
        return None
    cells = np.concatenate([part.cells for part in parts])
    names = parts[0].values
    return Carried(cells, {n: np.concatenate([part.values[n] for part in parts]) for n in names})
