"""Rolling rules over frames tile by tile: the bits of `Roll`, in the memory of a tile.

The mask is a hash of a cell's coordinates and a step sees one cell far, so a tile with K cells
around it can do K steps by itself; then those around it are fetched anew. Ranks share the tiles of
a frame, dealt anew in each; what one needs of another's cells it fetches (`near.py`).
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from vnca.core import Box, FloatArray, IntArray
from vnca.core.bricks import meeting
from vnca.core.volume import Volume
from vnca.direction import Carried
from vnca.direction.moment import DEEPEST, HIGHEST
from vnca.direction.silhouette import masses, total
from vnca.engine import open_session
from vnca.engine.domain import Domain
from vnca.io.painted.parts import tiles_of
from vnca.io.parts import SmokeParts
from vnca.painting import Painting, Ready, Roll, with_rest
from vnca.painting.frames import read_ahead
from vnca.painting.tiles import Tiling
from vnca.painting.tiles.begin import (
    BESIDE,
    Beginning,
    Begun,
    carried_in,
    frames_since,
    in_box,
    local_state,
    upstream,
    with_outside,
)
from vnca.painting.tiles.deal import dealt
from vnca.painting.tiles.halo import halos, likely_halo
from vnca.painting.tiles.kept import Keeping, Kept
from vnca.painting.tiles.near import Near
from vnca.painting.tiles.state import TiledState
from vnca.ranks import Alone, Ranks
from vnca.rule import Rule

_REACH = 8
"""Cells around tiles whose state is fetched from other ranks before it is known what is needed."""


@dataclass(frozen=True, eq=False)
class TiledRoll:
    """A rule made ready for a sequence that is painted tile by tile.

    Attributes:
        roll: The rule.
        tiling: How frames are cut.
        folder: Where scratch files are.
        tell: Is told what is being done.
        ranks: Who shares the tiles.
        worked: Cells times steps that this rank has done, of its tiles (own) and with those around
            (all).
    """

    roll: Roll
    tiling: Tiling
    folder: Path
    tell: Callable[[str], None]
    ranks: Ranks = field(default_factory=Alone)
    worked: Counter[str] = field(default_factory=Counter, init=False)
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
        begun, carried = self._begin(smoke, state)
        left = []
        for roll, each, was in zip(self.rolls, begun, (state, *state.layers), strict=True):
            if each.alive == 0:
                left.append(TiledState(was.channels, steps_done=was.steps_done))
                continue
            warmup = roll.config.warmup if len(was) == 0 else 0
            numbers = range(was.steps_done, was.steps_done + warmup + each.most)
            kept = self._stepped(roll, each, numbers, rest_from=was.steps_done + warmup)
            left.append(TiledState(was.channels, kept, each.alive, numbers.stop, smoke.frame))
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
            state: After its steps, with the cells around the box; see `around`.
            box: The cells.
            mass: The smoke of the frame in all, as painted and before, where it is to be kept.
        """
        roll, inner = self.roll, self._inner(box)
        aimed = roll.config.asks_for_places
        part = self._part(smoke, inner.grown(self._sight + BESIDE), motion=aimed)
        moment = replace(roll.moment_of(part), carried=state.carried)
        ready, states = [], []
        for each, left in zip(self.rolls, (state, *state.layers), strict=True):
            local = local_state(left, inner)
            domain = Domain(local.cells, each.reached)
            ready.append(Ready(part, domain, None, each.rule_of(part)))
            states.append(local)
        return roll.painting(moment, roll.seen(ready, states, moment), state, mass or (1.0, 1.0))

    def around(self, state: TiledState, boxes: Sequence[Box]) -> TiledState:
        """A state with what `painting` takes of it in some boxes, whoever keeps that."""
        return self._with_near(state, [self._inner(box) for box in boxes])

    def own(self, smoke: SmokeParts, boxes: Sequence[Box], finer: int = 1) -> list[int]:
        """The numbers of those of some boxes that this rank works on, as much smoke as each.

        Args:
            smoke: The frame.
            boxes: Cubes of one size, in order; all ranks have the same.
            finer: How many times as fine as the smoke's their cells are.
        """
        if self.ranks.size == 1:
            return list(range(len(boxes)))
        weights = [1 + smoke.count(box.coarsened(finer)) for box in boxes]
        ranks = dealt(boxes, weights, self.ranks.size)
        return [number for number, rank in enumerate(ranks) if rank == self.ranks.rank]

    def mass(self, smoke: SmokeParts, state: TiledState) -> tuple[float, float] | None:
        """How much smoke a frame has in all, as it is painted and before, where that matters."""
        roll = self.roll
        if not roll.config.keep_mass:
            return None
        finer = roll.grid * roll.finer
        box = smoke.box.refined(finer).grown(roll.beyond)
        tiles = list(tiles_of(box, self.tiling.edge * roll.finer))
        tiles = [tiles[number] for number in self.own(smoke, tiles, finer)]
        state = self.around(state, tiles)
        now, was = [np.zeros(0)], [np.zeros(0)]
        for tile in tiles:
            painting = self.painting(smoke, state, tile)
            now.append(masses(painting.density_field.within(tile)))
            was.append(masses(painting.smoke.density_field.within(tile)))
        every = self.ranks.every((np.concatenate(now), np.concatenate(was)))
        now, was = (list(each) for each in zip(*every, strict=True))
        return total(np.concatenate(now)), total(np.concatenate(was))

    def _inner(self, box: Box) -> Box:
        """The cells of the automaton that a box of the painting's shows."""
        roll = self.roll
        moved = roll.config.fluff * roll.grid
        return box.coarsened(roll.finer).grown(roll.colour_dilation + moved + 2 * BESIDE)

    def _with_near(self, state: TiledState, boxes: Sequence[Box]) -> TiledState:
        """A state, and those of its layers, with what others keep of it in boxes."""
        layers = tuple(self._with_near(layer, boxes) for layer in state.layers)
        kept = state.kept
        if kept is not None:
            kept = Near(self.ranks, kept, boxes, self.tiling.edge).filled(kept)
        return replace(state, kept=kept, layers=layers)

    @property
    def _sight(self) -> int:
        """How many cells far what is asked of a place may depend on the smoke."""
        asks = self.roll.config.asks_for_places
        return (DEEPEST + HIGHEST + BESIDE) * self.roll.grid if asks else 0

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

    def _begin(self, smoke: SmokeParts, before: TiledState) -> tuple[list[Begun], Carried | None]:
        """What cells begin with under each rule; and what is carried along."""
        tiles = self._tiles(smoke)
        tiles = [tiles[number] for number in self.own(smoke, tiles, self.roll.grid)]
        begun = [Beginning(self.folder, roll) for roll in self.rolls]
        carried: list[Carried] = []
        reach, left, done = _REACH, tiles, 0
        # Most smoke comes from near; tiles that are reached from farther wait for a second round.
        while any(self.ranks.every(len(left))):
            near = self._with_near(before, [tile.grown(reach) for tile in left])
            late, widest = [], reach
            for tile, part in self._parts(smoke, left, before):
                far = self._begin_tile(tile, part, near, begun, carried, reach)
                if far is not None:
                    late.append(tile)
                    widest = max(widest, far)
                    continue
                done += 1
                self.tell(f"frame {smoke.frame}: tile {done} of {len(tiles)} begun")
            left, reach = late, max(self.ranks.every(widest))
        seen = np.array(self.ranks.every(smoke.seen))
        smoke.require((float(seen[:, 0].min()), float(seen[:, 1].max())))
        return [each.done(self.ranks) for each in begun], self._joined(carried)

    def _parts(
        self, smoke: SmokeParts, tiles: Sequence[Box], before: TiledState
    ) -> Iterator[tuple[Box, Volume]]:
        """Tiles with the smoke in and around them, each read while the one before is worked on."""
        margin = max(roll.rule.config.dilation for roll in self.rolls) + self._sight + BESIDE
        parts = read_ahead(partial(self._part, smoke, tile.grown(margin)) for tile in tiles)
        for tile, part in zip(tiles, parts, strict=True):
            while (wanted := self._motion(part, tile, before)) > margin:
                margin = wanted
                part = self._part(smoke, tile.grown(margin))
            yield tile, part

    def _begin_tile(
        self,
        tile: Box,
        part: Volume,
        before: TiledState,
        begun: Sequence[Beginning],
        carried: list[Carried],
        reach: int,
    ) -> int | None:
        """Begin with a tile; or say from how far it has to be reached, if that is not fetched."""
        moment = self.roll.moment(part, before.carried)
        given, far = [], 0
        for each, was in zip(begun, (before, *before.layers), strict=True):
            domain = each.roll.domain(part, tile)
            if len(domain):
                ready = Ready(part, domain, None, each.roll.rule_of(part))
                box = upstream(each.roll, ready, was, moment)
                far = max(far, *np.subtract(tile.lower, box.lower))
                far = max(far, *np.subtract(box.upper, tile.upper))
                given.append((each, was, ready, box))
        if far > reach and self.ranks.size > 1:
            return int(far)
        if moment.carried is not None:
            carried.append(carried_in(moment.carried, tile))
        for each, was, ready, box in given:
            each.add(ready, local_state(was, box), moment)
        return None

    def _joined(self, parts: Sequence[Carried]) -> Carried | None:
        """What is carried in all tiles of all ranks, each of which has all of it."""
        every = [part for found in self.ranks.every(parts) for part in found]
        if not every:
            return None
        names = every[0].values
        return Carried(
            np.concatenate([part.cells for part in every]),
            {name: np.concatenate([part.values[name] for part in every]) for name in names},
        )

    def _motion(self, part: Volume, tile: Box, before: TiledState) -> int:
        """How far around a tile velocity has to be known to see where smoke came from."""
        velocity = part.velocity_field
        if velocity is None:
            return 0
        near = velocity.values[meeting(velocity.bricks, tile.grown(BESIDE))]
        fastest = float(np.abs(near).max(initial=0))
        times = [1.0]
        for roll, was in zip(self.rolls, (before, *before.layers), strict=True):
            times.append(roll.fastest * frames_since(was, part))
        widest = max(self.roll.reached.shape)
        return min(math.ceil(0.5 * fastest * max(times)) + 2 * BESIDE, widest + self.tiling.edge)

    def _stepped(self, roll: Roll, begun: Begun, numbers: range, *, rest_from: int) -> Kept:
        """The state after the steps of some numbers; from one of them on, cells may rest."""
        state, told = begun.values, begun.told
        if not numbers:
            return state
        edge, count = self.tiling.edge, len(numbers)
        tiles = [box for box in tiles_of(roll.reached, edge) if state.holds(box)]
        rounds = max(1, -(-count // self._halo(state, tiles, count)))
        ends = [numbers.start + count * end // rounds for end in range(rounds + 1)]
        widest = max(end - begin for begin, end in pairwise(ends))
        near = Near(self.ranks, state, [tile.grown(widest) for tile in tiles], edge)
        told = near.filled(told)
        # What others send comes while the tiles are computed that do not wait for it.
        tiles.sort(key=lambda tile: near.touches(tile.grown(widest)))
        for begin, end in pairwise(ends):
            after = Keeping(self.folder, roll.rule.config.channels)
            coming = near.begin(state)
            for number, tile in enumerate(tiles, 1):
                if near.touches(tile.grown(widest)):
                    state = coming.wait()
                given = state, told, tile, range(begin, end), rest_from
                after.add(*self._block(roll, begun.rule, *given))
                coming.poll()
                self.tell(f"step {end - numbers.start} of {count}, tile {number}")
            coming.wait()
            state = after.kept()
        return state

    def _halo(self, state: Kept, tiles: Sequence[Box], steps: int) -> int:
        """How many cells around tiles they are given, the same on all ranks."""
        if self.tiling.halo is not None:
            return self.tiling.halo
        if steps not in self._halos:
            wide = [tile.grown(halos(steps)[-1]) for tile in tiles]
            known = Near(self.ranks, state, wide, self.tiling.edge).known
            self._halos[steps] = likely_halo(known, tiles, steps, self.ranks)
        return self._halos[steps]

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
        begun = [with_outside(values)]
        del values  # nor has what they begin with a name, or it would be kept to the last step
        stepped = session.run(session.upload(begun.pop()), together)
        for number in range(together.stop, numbers.stop):
            stepped = with_rest(session, stepped, number, rest=steps <= number - rest_from)
        inside = in_box(cells, tile)
        self.worked.update(own=int(inside.sum()) * len(numbers), all=len(cells) * len(numbers))
        return cells[inside], session.read(stepped)[:-1][inside]
