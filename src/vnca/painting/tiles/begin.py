"""What the cells of a frame begin with: the state of those they come from, tile by tile."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.volume import Volume
from vnca.direction import Carried, Moment
from vnca.painting import Ready, Roll, RollState
from vnca.painting.tiles.kept import Keeping, Kept
from vnca.painting.tiles.state import TiledState
from vnca.ranks import Ranks
from vnca.rule import Rule

BESIDE = 2
"""Cells around that interpolation takes."""


class Begun(NamedTuple):
    """What the cells of a frame begin with.

    Attributes:
        rule: With the weights of the frame.
        values: Their state, of those of this rank.
        told: What they are conditioned on, and in a last column how many steps each does.
        most: The most steps that one does on any rank.
        alive: How many cells there are on all ranks.
    """

    rule: Rule
    values: Kept
    told: Kept
    most: int
    alive: int


class Beginning:
    """What the cells of a frame begin with under a rule, tile by tile."""

    def __init__(self, folder: Path, roll: Roll) -> None:
        config = roll.rule.config
        self.roll, self._rule, self._most = roll, roll.rule, 0
        self._values = Keeping(folder, config.channels)
        self._told = Keeping(folder, config.conditioning_width + 1)

    def add(self, ready: Ready, was: RollState, moment: Moment) -> None:
        """Some cells, with the state where they come from."""
        cells = ready.domain.cells
        self._rule = ready.rule
        steps = np.broadcast_to(self.roll.steps(moment, ready.domain), len(cells))
        self._most = max(self._most, int(steps.max()))
        self._values.add(cells, self.roll.begun(ready, was, moment)[:-1])
        column = steps[:, None].astype(np.float32)
        self._told.add(cells, np.concatenate([self.roll.told(ready, moment), column], axis=1))

    def done(self, ranks: Ranks) -> Begun:
        """All of them."""
        values = self._values.kept()
        most, alive = np.array(ranks.every((self._most, len(values)))).T
        return Begun(self._rule, values, self._told.kept(), int(most.max()), int(alive.sum()))


def upstream(roll: Roll, ready: Ready, was: TiledState, moment: Moment) -> Box:
    """The cells from which those of a tile may have their state."""
    low = ready.domain.cells.min(axis=0).astype(float)
    high = ready.domain.cells.max(axis=0) + 1.0
    velocity = ready.smoke.velocity_field
    if velocity is not None and len(was):
        speed = roll.pattern_speed(moment, ready.domain)
        times = np.array([[np.min(speed)], [np.max(speed)]], float) * frames_since(was, ready.smoke)
        moving = velocity.values.reshape(-1, 3)
        ends = [moving.min(axis=0, initial=0), moving.max(axis=0, initial=0)]
        moved = np.concatenate([times * end for end in ends])
        low -= np.maximum(moved.max(axis=0), 0)
        high -= np.minimum(moved.min(axis=0), 0)
    lower = np.maximum(np.floor(low) - BESIDE, roll.reached.lower).astype(int).tolist()
    upper = np.minimum(np.ceil(high) + BESIDE, roll.reached.upper).astype(int).tolist()
    return Box((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


def frames_since(was: TiledState, smoke: Volume) -> int:
    """For how many frames smoke has moved since a state."""
    return 1 if was.frame is None else max(1, smoke.frame - was.frame)


def local_state(state: TiledState, box: Box) -> RollState:
    """A state in a box."""
    if state.kept is None:
        return replace(RollState.empty(state.channels, state.steps_done), frame=state.frame)
    cells, values = state.kept.within(box)
    return RollState(cells, with_outside(values), state.steps_done, state.frame)


def with_outside(values: FloatArray) -> FloatArray:
    """Values `[n, C]` and a last row of zeros."""
    return np.concatenate([values, np.zeros((1, values.shape[1]), values.dtype)])


def in_box(cells: AnyArray, box: Box) -> AnyArray:
    """Which of some cells `[n, 3]` lie in a box, `[n]`."""
    return np.asarray(((cells >= box.lower) & (cells < box.upper)).all(axis=1))


def carried_in(carried: Carried, box: Box) -> Carried:
    """What is carried by the smoke in a box."""
    own = in_box(carried.cells, box)
    return Carried(carried.cells[own], {n: values[own] for n, values in carried.values.items()})
