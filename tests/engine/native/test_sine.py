"""The native kernel's own sines and cosines."""

import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.engine import native
from vnca.engine.automaton import DecoderWeights
from vnca.engine.native import decoding

KERNELS = [] if native.unavailable() else decoding.decode_instructions()
pytestmark = pytest.mark.skipif(not KERNELS, reason="the native kernel was not built")


def sines(values: FloatArray, instructions: str) -> tuple[FloatArray, FloatArray]:
    """Sines and cosines of four values a point, through a network that sees nothing else.

    Its other two layers are so small that their sines are themselves.
    """
    small = 2.0**-13
    points = len(values) // 4
    state = np.zeros((points + 1, 8), np.float32)
    state[:-1, 4:] = values.reshape(-1, 4)
    rows = np.full((8, points), points, np.int32)
    rows[0] = np.arange(points)
    unit, none = np.eye(4, dtype=np.float32), np.zeros(4, np.float32)
    first = np.concatenate([0 * unit, unit], axis=1)
    weights = DecoderWeights(first, none, small * unit, none, unit, none, unit / small, none)
    arguments = (state, rows, np.zeros((points, 3), np.float32), weights)
    sine = decoding.decode(*arguments, instructions=instructions)
    ones = np.ones((points, 4), np.float32)
    to_state, _ = decoding.decode_backward(*arguments, ones, instructions=instructions)
    return sine.ravel(), to_state[:-1, 4:].ravel()


@pytest.mark.parametrize("instructions", KERNELS)
@pytest.mark.parametrize("reach", [1.0, 3.2, 30.0, 1e3, 9.9e4, 1e30])
def test_sines_and_cosines_are_off_by_no_more_than_the_readme_says(
    instructions: str, reach: float
) -> None:
    random = np.random.default_rng(0)
    quarters = np.round(random.uniform(-reach, reach, 2000) / (np.pi / 2)) * (np.pi / 2)
    values = np.concatenate([random.uniform(-reach, reach, 18_000), quarters]).astype(np.float32)
    sine, cosine = sines(values, instructions)
    exact = values.astype(np.float64)
    # Beside the sine itself, the small layers round twice more.
    assert np.abs(sine - np.sin(exact)).max() < 2.5e-7
    assert np.abs(cosine - np.cos(exact)).max() < 3e-7


@pytest.mark.parametrize("instructions", KERNELS)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_what_has_no_sine_has_none(instructions: str) -> None:
    values = np.array([np.nan, np.inf, -np.inf, 0.5] * 5, np.float32)
    for numbers in sines(values, instructions):
        assert np.isnan(numbers[[0, 1, 2]]).all()
