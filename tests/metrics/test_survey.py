import dataclasses

import numpy as np
import pytest

from vnca.core.volume import Volume
from vnca.metrics import DensityChange
from vnca.painting import Painting, RollState


def painting(smoke: Volume, density: np.ndarray) -> Painting:
    colour = np.ones((*density.shape, 3), np.float32)
    return Painting(smoke, density.astype(np.float32), colour, RollState.empty(4))


def test_what_is_moved_and_what_that_comes_to(tiny_smoke: Volume) -> None:
    density = tiny_smoke.density.copy()
    density[:6] *= 1.5
    density[6:] *= 0.5
    moved, change = DensityChange.of(painting(tiny_smoke, density))
    assert moved == pytest.approx(0.5, abs=1e-5)
    assert change == pytest.approx(0, abs=1e-5)
    assert DensityChange.of(painting(tiny_smoke, 1.2 * tiny_smoke.density)).mass_change == (
        pytest.approx(0.2, abs=1e-5)
    )


def test_a_frame_without_smoke_does_not_change(tiny_smoke: Volume) -> None:
    nothing = dataclasses.replace(tiny_smoke, density=np.zeros_like(tiny_smoke.density))
    assert DensityChange.of(painting(nothing, nothing.density)) == (0, 0)
