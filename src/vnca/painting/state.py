"""What goes from frame to frame of a painting, and a frame that is ready to be painted."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.core.volume import Volume
from vnca.direction import Carried
from vnca.engine import Session
from vnca.engine.domain import Domain
from vnca.rule import Rule


@dataclass(frozen=True, eq=False)
class RollState:
    """What a frame leaves to the next: all it takes to go on from there.

    Attributes:
        cells: `[n, 3]` index coordinates, in the lattice, of the cells alive; none before the
            first frame and after one without smoke.
        values: `[n + 1, C]`, their state and a last row of zeros.
        steps_done: Steps since the sequence began, by which the next ones are numbered.
        frame: Number of that frame, if there was one.
        carried: What goes along with the smoke beside it, where anything does.
        layers: What the rules of further layers left, of each its own.
    """

    cells: IntArray
    values: FloatArray
    steps_done: int = 0
    frame: int | None = None
    carried: Carried | None = None
    layers: tuple["RollState", ...] = ()

    def __len__(self) -> int:
        """How many cells are alive."""
        return len(self.cells)

    @property
    def channels(self) -> int:
        """How many numbers a cell has."""
        return self.values.shape[1]

    def pieces(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Cells and their values, `[n, C]`, all of them."""
        yield self.cells, self.values[:-1]

    @classmethod
    def empty(cls, channels: int, steps_done: int = 0) -> "RollState":
        """That of nothing painted yet."""
        cells = np.zeros((0, 3), dtype=np.int32)
        return cls(cells, np.zeros((1, channels), dtype=np.float32), steps_done)


class Ready(NamedTuple):
    """A frame, with all that painting it takes beside what the frame before it left.

    Attributes:
        smoke: On a grid as fine as the automaton's.
        domain: Its active cells.
        session: The automaton on them; None if there are none.
        rule: With the weights of this frame.
        conditioning: `[n, P]`, where styles are still to be mixed into it.
        layers: What further layers take, of each its own.
    """

    smoke: Volume
    domain: Domain
    session: Session | None
    rule: Rule
    conditioning: FloatArray | None = None
    layers: tuple["Ready", ...] = ()

    @property
    def frame(self) -> int:
        """Its number in the sequence."""
        return self.smoke.frame
