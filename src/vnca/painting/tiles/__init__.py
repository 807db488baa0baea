"""Painting sequences whose frames are larger than memory: tile by tile, to the same files."""

from dataclasses import dataclass

from vnca.core.bricks import EDGE
from vnca.core.errors import OptionError

EDGES = (768, 512, 384, 256, 192, 128, 96, 64, 48, 32)
"""Cells along a side of the tiles that are chosen from, the largest first."""
_LIKELY_HALO = 12
_TILES_OF_A_RANK = 4
_CELL, _PAINTED_CELL, _REST = 360, 130, 140_000_000
"""Bytes, fitted to what frames of 0.1 to 10 million cells took, within 15 %."""


@dataclass(frozen=True)
class Tiling:
    """How frames are cut.

    Attributes:
        edge: Cells of the automaton along an edge of a tile, a multiple of 8.
        halo: Cells around it that it is given; chosen by cost if None.
    """

    edge: int
    halo: int | None = None

    def __post_init__(self) -> None:
        if self.edge < EDGE or self.edge % EDGE:
            raise OptionError(f"`tile` {self.edge}: expected a multiple of {EDGE}")
        if self.halo is not None and self.halo < 1:
            raise OptionError(f"`halo` {self.halo}: at least 1 is needed")


def bytes_needed(cells: int, *, grid: int, finer: int) -> int:
    """About what a program takes that paints so many cells of smoke at a time.

    Args:
        cells: As they are in the file.
        grid: How many times as fine the automaton's are,
        finer: and how many times as fine as those the painting's.
    """
    return cells * grid**3 * (_CELL + _PAINTED_CELL * finer**3) + _REST


def likely_edge(budget: float, *, grid: int, finer: int) -> int:
    """The largest tiles that fit a memory even where all of one is smoke.

    Raises:
        OptionError: If none do.
    """
    for edge in EDGES:
        wide = edge + 2 * _LIKELY_HALO
        if bytes_needed(wide**3, grid=1, finer=finer) <= budget:
            return edge
    least = bytes_needed((EDGES[-1] + 2 * _LIKELY_HALO) ** 3, grid=1, finer=finer)
    raise OptionError(f"`memory_budget`: at least {least / 1e9:.1f}GB are needed here")


def shared_edge(budget: float, cells: int, ranks: int, *, grid: int, finer: int) -> int:
    """The largest tiles of which each of some ranks gets a few, and that fit its memory.

    Args:
        budget: Memory of a rank.
        cells: Of smoke in the fullest frame, as they are in the file.
        ranks: How many there are.
        grid: As of `bytes_needed`, and so
        finer: is this.

    Raises:
        OptionError: If none fit.
    """
    fair = (cells * grid**3 / (_TILES_OF_A_RANK * ranks)) ** (1 / 3)
    most = likely_edge(budget, grid=grid, finer=finer)
    return next((edge for edge in EDGES if edge <= min(fair, most)), EDGES[-1])
