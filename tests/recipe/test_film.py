import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.recipe.film import FilmConfig, Shown, picture, soft_background

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


@pytest.mark.parametrize("field_of_view", [0.0, 30.0])
def test_cells_finer_than_pixels_are_averaged_and_coarser_ones_seen_along_one_ray(
    field_of_view: float,
) -> None:
    """A wall of random grey cells, each of which should count in the pixel that shows it."""
    random = np.random.default_rng(0)
    wall = np.ones((96, 3, 96), np.float32)
    colour = np.repeat(random.random((*wall.shape, 1), np.float32), 3, axis=-1)
    shown = Shown(Volume(wall, None, (0, 0, 0), np.eye(4), 1), colour, 9.0)
    bounds = np.full(3, -0.5), np.array(wall.shape) - 0.5

    def seen(size: int, supersampling: int | None = None) -> FloatArray:
        config = FilmConfig(
            rows=size, columns=size, elevation=0.0, field_of_view=field_of_view, light=0.0,
            supersampling=supersampling,
        )  # fmt: skip
        return picture(shown, config, bounds=bounds, turned=0.0).rgba[..., 0]

    # 104 cells from edge to edge: three and a half across a pixel.
    exact = seen(120, 4).reshape(30, 4, 30, 4).mean((1, 3))
    inside = slice(3, -3)
    found, single = (
        np.abs(seen(30, rays)[inside, inside] - exact[inside, inside]).mean() for rays in (None, 1)
    )
    assert found < 0.2 * single
    np.testing.assert_array_equal(seen(30), seen(30, 4))
    np.testing.assert_array_equal(seen(120), seen(120, 1))


@pytest.mark.parametrize("supersampling", [0, 5])
def test_a_pixel_has_at_least_one_ray_and_at_most_four_times_four(supersampling: int) -> None:
    with pytest.raises(OptionError, match=r"`film\.supersampling` [05]: must be from 1 to 4"):
        FilmConfig(supersampling=supersampling)
