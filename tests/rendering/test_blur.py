"""What a shutter that stays open makes of a picture."""

import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.rendering.blur import blurred


def bar(size: int = 48, width: int = 8) -> FloatArray:
    """White, upright, in the middle of nothing."""
    picture = np.zeros((size, size, 4), np.float32)
    picture[:, (size - width) // 2 : (size + width) // 2] = 1
    return picture


def moving(picture: FloatArray, right: float, down: float) -> FloatArray:
    """What is seen moves so; there is no motion where nothing is."""
    return np.where(picture[..., 3:] > 0, np.array([right, down], np.float32), 0).astype(np.float32)


def test_what_moves_is_spread_along_its_way() -> None:
    picture = bar()
    result = blurred(picture, moving(picture, 12, 0), 0.5)
    profile = result[24, :, 3]
    # Six pixels wide ramps in the place of the borders; as much as before in all.
    assert profile.sum() == pytest.approx(8, rel=0.02)
    assert profile[23] == pytest.approx(1, abs=0.02)
    assert profile[20] == pytest.approx(0.58, abs=0.1)
    assert profile[18] == pytest.approx(0.25, abs=0.12)
    assert profile[15] == pytest.approx(0, abs=0.02)
    np.testing.assert_allclose(result[..., 0], result[..., 3])


def test_what_moves_along_itself_stays() -> None:
    picture = bar()
    result = blurred(picture, moving(picture, 0, 12), 0.5)
    np.testing.assert_allclose(result, picture, atol=1e-5)


@pytest.mark.parametrize(("speed", "shutter"), [(12.0, 0.0), (0.0, 1.0), (0.5, 0.5)])
def test_without_motion_or_shutter_nothing_changes(speed: float, shutter: float) -> None:
    picture = bar()
    assert blurred(picture, moving(picture, speed, speed), shutter) is picture


def test_what_stands_still_beside_stays_sharp() -> None:
    picture = bar(64, 4)
    picture[:, 50:54] = 1
    motion = moving(picture, 8, 0)
    motion[:, 50:] = 0
    result = blurred(picture, motion, 0.5)
    np.testing.assert_allclose(result[:, 50:54], picture[:, 50:54], atol=1e-5)
    assert result[32, 29, 3] > 0.1
