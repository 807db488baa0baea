import sys

import numpy as np
import pytest

from vnca.core.errors import BackendUnavailableError
from vnca.core.typing import FloatArray
from vnca.metrics.estimators import dis, farneback, ours


def waves(right: float, down: float) -> FloatArray:
    """A pattern of many waves, moved."""
    y, x = np.mgrid[:64, :96].astype(np.float32) - np.float32([down, right]).reshape(2, 1, 1)
    random = np.random.default_rng(0)
    u, v, phase = random.uniform(-0.6, 0.6, 40), random.uniform(-0.6, 0.6, 40), np.arange(40)
    pattern = np.cos(u[:, None, None] * x + v[:, None, None] * y + phase[:, None, None]).sum(0)
    return np.clip(0.5 + 0.03 * pattern, 0, 1).astype(np.float32)


@pytest.mark.parametrize("estimator", [ours, dis, farneback])
@pytest.mark.parametrize("moved", [(2.0, 0.0), (0.0, 2.0), (-1.0, -1.0)])
def test_all_estimators_agree_on_what_is_right_and_down(estimator, moved) -> None:
    flow = estimator()(waves(0, 0), waves(*moved))
    assert flow.shape == (64, 96, 2)
    assert flow.dtype == np.float32
    np.testing.assert_allclose(flow[12:-12, 12:-12].mean((0, 1)), moved, atol=0.4)


@pytest.mark.parametrize("estimator", [dis, farneback])
def test_opencv_is_asked_for_by_the_extra_that_has_it(estimator, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(BackendUnavailableError, match=r"vnca\[evaluate\]"):
        estimator()
