"""From the state of a cell to what is seen of it."""

import numpy as np

from vnca.automaton.rule import COLOUR, DENSITY_CHANGE, DENSITY_LIMIT
from vnca.colour import srgb_to_linear
from vnca.typing import FloatArray


def colours(state: FloatArray) -> FloatArray:
    """Linear RGB `[..., 3]` in [0, 1] of states `[..., C]`; the channels hold sRGB − ½.

    The state is display-referred because training compares pictures as they are seen; colour is
    linear wherever light is computed or a file is written.
    """
    return srgb_to_linear(np.clip(state[..., COLOUR] + 0.5, 0, 1)).astype(np.float32)


def density_factors(state: FloatArray, *, strength: float = 1.0) -> FloatArray:
    """1 + Δd `[...]` of states `[..., C]`: what the input density is multiplied by, 0.5 to 1.5."""
    change = np.clip(state[..., DENSITY_CHANGE], -DENSITY_LIMIT, DENSITY_LIMIT)
    return 1 + strength * change
