"""From the state of cells to what is seen of it: at them, between them and in their parts."""

from functools import partial

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError
from vnca.engine import array_decode, backend_named
from vnca.engine.domain import Domain
from vnca.rule import COLOUR, DENSITY_CHANGE, DENSITY_LIMIT, Rule


def colours(state: FloatArray) -> FloatArray:
    """Linear RGB `[..., 3]` in [0, 1] of states, or of what is seen of them, `[..., C]`.

    The channels hold sRGB − ½. The state is display-referred because training compares pictures as
    they are seen; colour is linear wherever light is computed or a file is written.
    """
    return srgb_to_linear(np.clip(state[..., COLOUR] + 0.5, 0, 1)).astype(np.float32)


def density_factors(state: FloatArray, *, strength: float | FloatArray = 1.0) -> FloatArray:
    """1 + Δd `[...]` of states, or of what is seen of them, `[..., C]`.

    It is what the input density is multiplied by, from 0.5 to 1.5; with another strength, one for
    all or for each, nearer to 1.
    """
    change = np.clip(state[..., DENSITY_CHANGE], -DENSITY_LIMIT, DENSITY_LIMIT)
    return 1 + strength * change


class Between:
    """What is seen of a rule's states between its cells: its decoder, bound to its kernel.

    A rule without a decoder shows its states interpolated. What is seen are the first four channels
    of a state, for `colours` and `density_factors`.

    Attributes:
        has_decoder: Whether the rule has one.
    """

    def __init__(self, rule: Rule, backend: str = "auto", *, threads: int | None = None) -> None:
        """Choose the kernel.

        Args:
            rule: Whose states are seen.
            backend: As of the automaton's; those that compute on tensors decode on arrays.
            threads: How many the native kernel uses; by default one for each core.

        Raises:
            BackendUnavailableError: If the backend asked for cannot run here.
        """
        decode = array_decode(backend, threads=threads)
        weights = rule.decoder.weights if rule.decoder is not None else None
        self.has_decoder = weights is not None
        if weights is None:
            decode = backend_named("numpy").array_decode()
        self._at = partial(decode.decode, weights=weights)
        self._parts = partial(decode.decode_parts, weights=weights, most=DENSITY_LIMIT)

    def at(self, state: FloatArray, rows: IntArray, fractions: FloatArray) -> FloatArray:
        """What is seen `[m, 4]` at points of a state `[n + 1, C]`.

        Args:
            state: Of a domain.
            rows: `[8, m]` and
            fractions: `[m, 3]` of the points, from `Domain.corners`.
        """
        return self._at(state, rows, fractions)

    def parts(self, state: FloatArray, domain: Domain, parts: int) -> tuple[FloatArray, FloatArray]:
        """What all cells show, part by part: means over `SAMPLES` points along each axis.

        Args:
            state: Of a domain `[n + 1, C]`.
            domain: Its cells.
            parts: Along each axis of a cell, at most 8.

        Returns:
            Linear RGB `[n, parts, parts, parts, 3]`, and Δd `[n, parts, parts, parts]` within its
            limits.
        """
        colour = np.empty((len(domain), *3 * (parts,), 3), np.float32)
        change = np.empty(colour.shape[:-1], np.float32)
        at_once = max(1, _POINTS_AT_ONCE // (parts * SAMPLES[parts]) ** 3)
        for start in range(0, len(domain), at_once):
            cells = np.arange(start, min(start + at_once, len(domain)), dtype=np.int32)
            asked = (state, cells, domain.neighbours, parts, SAMPLES[parts])
            some = slice(start, start + len(cells))
            colour[some], change[some] = self._parts(*asked)
        return colour, change


SAMPLES = {1: 3, 2: 2, 3: 2, 4: 2, 5: 1, 6: 1, 7: 1, 8: 1}
"""Points along each axis of a part at which a decoder is asked, by how many parts a cell has along
it: what is finer than the parts is averaged, instead of becoming grain."""
_POINTS_AT_ONCE = 1 << 22
"""A program can be interrupted between, which in the native core it cannot."""


def require_refinement(factor: int) -> None:
    """Raise `OptionError` unless paintings can be so many times as fine as the smoke."""
    if factor not in SAMPLES:
        raise OptionError(f"`refine` {factor}: must be from 1 to {max(SAMPLES)}")
