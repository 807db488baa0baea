"""From the state of cells to what is seen of it, at them and between them."""

from functools import partial

import numpy as np

from vnca.core.colour import srgb_to_linear
from vnca.core.typing import FloatArray, IntArray
from vnca.engine.decode_backend import array_decode
from vnca.engine.numpy import decode as array_reference
from vnca.rule.rule import COLOUR, DENSITY_CHANGE, DENSITY_LIMIT, Rule


def colours(state: FloatArray) -> FloatArray:
    """Linear RGB `[..., 3]` in [0, 1] of states, or of what is seen of them, `[..., C]`.

    The channels hold sRGB − ½. The state is display-referred because training compares pictures as
    they are seen; colour is linear wherever light is computed or a file is written.
    """
    return srgb_to_linear(np.clip(state[..., COLOUR] + 0.5, 0, 1)).astype(np.float32)


def density_factors(state: FloatArray, *, strength: float = 1.0) -> FloatArray:
    """1 + Δd `[...]` of states, or of what is seen of them, `[..., C]`.

    It is what the input density is multiplied by, from 0.5 to 1.5.
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
            decode = array_reference
        self._at = partial(decode.decode, weights=weights)
        self._in_cells = partial(decode.decode_cells, weights=weights)

    def at(self, state: FloatArray, rows: IntArray, fractions: FloatArray) -> FloatArray:
        """What is seen `[m, 4]` at points of a state `[n + 1, C]`.

        Args:
            state: Of a domain.
            rows: `[8, m]` and
            fractions: `[m, 3]` of the points, from `Domain.corners`.
        """
        return self._at(state, rows, fractions)

    def in_cells(
        self, state: FloatArray, cells: IntArray, neighbours: IntArray, factor: int
    ) -> FloatArray:
        """What is seen `[m, factor, factor, factor, 4]` at the centres of the parts of cells.

        Args:
            state: Of a domain `[n + 1, C]`.
            cells: `[m]` rows of the cells that are to be seen.
            neighbours: `[27, n]` of the domain.
            factor: Parts along each axis of a cell, at most 8.

        Raises:
            ShapeError: If the native kernel runs, and there are more.
        """
        return self._in_cells(state, cells, neighbours, factor)
