"""What goes along with the smoke: its age, and what it was given when it appeared."""

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from vnca.core import AnyArray, Box, FloatArray, IntArray
from vnca.core.bricks import cells_at
from vnca.core.field import Field
from vnca.direction.mixing import Answer
from vnca.direction.moment import Moment, between
from vnca.direction.values import Value
from vnca.io.velocity import interpolated


@dataclass(frozen=True, eq=False)
class Carried:
    """Numbers that belong to smoke, where it is in one frame.

    Attributes:
        cells: `[n, 3]` index coordinates of the smoke.
        values: Of each thing that is carried, by what it is in words, `[n]`.
    """

    cells: IntArray
    values: Mapping[str, FloatArray] = field(default_factory=dict)

    @cached_property
    def _rows(self) -> Field:
        (x, y, z), (u, v, w) = self.cells.min(axis=0).tolist(), self.cells.max(axis=0).tolist()
        box = Box((x, y, z), (u + 1, v + 1, w + 1))
        rows = np.arange(len(self.cells), dtype=np.int32)
        return Field.from_cells(self.cells, rows, box, outside=np.int32(-1))

    def at(self, name: str, places: AnyArray) -> tuple[FloatArray, AnyArray]:
        """A number at places `[n, 3]`, and whether there was smoke that has one, `[n]`."""
        if not len(self.cells) or name not in self.values:
            return np.zeros(len(places), np.float32), np.zeros(len(places), bool)
        rows = self._rows
        known = replace(rows, values=rows.values >= 0, outside=False)
        values = replace(rows, values=self.values[name][rows.values][..., None], outside=0)
        lower, upper = np.array(rows.box.lower) - 1, np.array(rows.box.upper)
        near = ((places > lower) & (places < upper)).all(axis=1)
        found, is_known = interpolated(values, known, places)
        return found[:, 0], is_known & near


class Carriage(Value):
    """A value that smoke takes along."""

    grows: ClassVar[float]
    """What a frame adds to it."""

    @abstractmethod
    def born(self, moment: Moment, places: AnyArray) -> Answer:
        """What smoke has that appears at places of a frame."""

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        born = self.born(moment, places)
        if moment.carried is None:
            return born
        found, is_known = moment.carried.at(repr(self), places)
        return np.where(is_known, found, np.float32(born))


@dataclass(frozen=True)
class Advected(Carriage):
    """What a value was where and when the smoke appeared."""

    of: Value
    grows: ClassVar[float] = 0.0

    def born(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Carriage.born`."""
        return self.of.at(moment, places)


@dataclass(frozen=True)
class Age(Carriage):
    """For how many frames smoke has been there."""

    grows: ClassVar[float] = 1.0

    def born(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Carriage.born`."""
        return 0.0


def carry(before: Carried | None, values: Iterable[Value], moment: Moment) -> Carried | None:
    """What is carried by the smoke of a frame, from the frame before; None of nothing.

    Each cell looks back along the velocity of this frame, in two steps; where it finds no smoke, it
    has appeared.

    Args:
        before: What the frame before left; None for the first.
        values: All that is asked for.
        moment: The frame.

    Reference: Stam 1999, section 3.2 (tracing back).
    """
    wanted = [value for value in values if isinstance(value, Carriage)]
    if not wanted:
        return None
    smoke = moment.is_smoke
    cells = cells_at(smoke.bricks, smoke.values)
    moment = replace(moment, carried=before)
    origin = _traced(moment, cells)
    carried = {}
    for value in wanted:
        born = np.broadcast_to(np.float32(value.born(moment, cells)), len(cells))
        if before is None:
            carried[repr(value)] = born.copy()
            continue
        found, is_known = before.at(repr(value), origin)
        carried[repr(value)] = np.where(is_known, found + np.float32(value.grows), born)
    return Carried(cells, carried)


def _traced(moment: Moment, cells: IntArray) -> AnyArray:
    """Where the smoke at cells `[n, 3]` was a frame ago."""
    velocity = moment.smoke.velocity_field
    if velocity is None:
        return cells.astype(np.float64)
    halfway = cells - 0.5 * velocity.gather(cells)
    return cells - between(velocity, halfway).astype(np.float64)
