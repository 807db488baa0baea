import numpy as np
import pytest

from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.recipe.film import soft_background

DARK = srgb_to_linear(np.array([16, 16, 20]) / 255).tolist()


def test_it_is_brightest_in_the_middle_and_darkest_in_the_corners() -> None:
    picture = soft_background(DARK, 48, 64)
    assert picture.shape == (48, 64, 3)
    middle, corner = picture[20:28, 28:36].mean((0, 1)), picture[:4, :4].mean((0, 1))
    assert (middle > DARK).all()
    assert (corner < DARK).all()


def test_it_is_the_same_from_every_corner_but_for_the_dither() -> None:
    picture = linear_to_srgb(soft_background(DARK, 40, 40))
    np.testing.assert_allclose(picture, picture[::-1, ::-1], atol=1.01 / 255)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_black_and_white_stay_what_they_are_in_the_middle(level: float) -> None:
    middle = soft_background([level] * 3, 64, 64)[30:34, 30:34]
    np.testing.assert_allclose(middle, level, atol=0.01)


def test_a_gradient_has_no_bands() -> None:
    """Rounded to 8 bits, hardly any two neighbouring blocks of pixels are alike."""
    rounded = np.round(linear_to_srgb(soft_background(DARK, 512, 512)[..., 0]) * 255)
    blocks = rounded.reshape(64, 8, 64, 8).mean((1, 3))
    assert np.ptp(blocks) > 4
    assert (np.diff(blocks, axis=1) == 0).mean() < 0.2
