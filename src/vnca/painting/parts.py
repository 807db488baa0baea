"""What a decoder shows in the parts of cells: the grid of a painting finer than the automaton's."""

from collections.abc import Iterator

import numpy as np

from vnca.core.errors import OptionError
from vnca.core.typing import FloatArray
from vnca.engine.domain import Domain
from vnca.rule.paint import Between, colours, density_factors

SAMPLES = {1: 3, 2: 2, 3: 2, 4: 2, 5: 1, 6: 1, 7: 1, 8: 1}
"""Points along each axis of a part at which a decoder is asked, by how many parts a cell has along
it: what is finer than the parts is averaged, instead of becoming grain."""
_POINTS_AT_ONCE = 1 << 20


def require_refinement(factor: int) -> None:
    """Raise `OptionError` unless paintings can be so many times as fine as the smoke."""
    if factor not in SAMPLES:
        raise OptionError(f"`refine` {factor}: must be from 1 to {max(SAMPLES)}")


def parts_of_cells(
    between: Between, state: FloatArray, domain: Domain, parts: int
) -> Iterator[tuple[slice, FloatArray]]:
    """What is seen in the cells of a domain, some of them at a time.

    Args:
        between: What is seen between cells.
        state: `[n + 1, C]`.
        domain: Its cells.
        parts: Of a cell along each axis.

    Yields:
        Which cells, and `[m, parts, s, parts, s, parts, s, 4]`, s points along each axis of a part.
    """
    samples = SAMPLES[parts]
    along = parts * samples
    at_once = max(1, _POINTS_AT_ONCE // along**3)
    for start in range(0, len(domain), at_once):
        some = slice(start, min(start + at_once, len(domain)))
        rows = np.arange(some.start, some.stop, dtype=np.int32)
        seen = between.in_cells(state, rows, domain.neighbours, along)
        yield some, seen.reshape(len(rows), *3 * (parts, samples), -1)


def colour_means(seen: FloatArray) -> FloatArray:
    """Linear RGB `[m, parts, parts, parts, 3]` of what `parts_of_cells` gives."""
    return colours(seen).mean((2, 4, 6))


def density_means(seen: FloatArray, *, strength: float) -> FloatArray:
    """Factors of the density `[m, parts, parts, parts]` of what `parts_of_cells` gives."""
    return density_factors(seen, strength=strength).mean((2, 4, 6))
