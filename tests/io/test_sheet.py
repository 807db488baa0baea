import numpy as np
import pytest

from vnca.core.errors import OptionError, ShapeError
from vnca.io.sheet import contact_sheet

RED, GREEN = np.zeros((2, 10, 20, 3), np.float32)
RED[..., 0] = 1
GREEN[..., 1] = 1


def test_pictures_stand_in_rows_with_gaps_between() -> None:
    sheet = contact_sheet([[RED, GREEN], [GREEN]], gap=4, background=(0, 0, 1))
    assert sheet.shape == (4 + 10 + 4 + 10 + 4, 4 + 20 + 4 + 20 + 4, 3)
    np.testing.assert_array_equal(sheet[4:14, 4:24], RED)
    np.testing.assert_array_equal(sheet[4:14, 28:48], GREEN)
    np.testing.assert_array_equal(sheet[18:28, 4:24], GREEN)
    assert (sheet[18:28, 28:48] == [0, 0, 1]).all()
    assert (sheet[:, :4] == [0, 0, 1]).all()
    assert (sheet[-4:] == [0, 0, 1]).all()


def test_smaller_pictures_are_centred_among_larger_ones() -> None:
    sheet = contact_sheet([[GREEN[:6, :8]], [RED]], gap=2)
    np.testing.assert_array_equal(sheet[2:8, 8:16], GREEN[:6, :8])
    assert (sheet[2:8, :8] == 1).all()


@pytest.mark.parametrize(("background", "ink"), [(1.0, 0.0), (0.0, 1.0)])
def test_captions_are_legible_on_any_background_and_stay_below_their_picture(
    background, ink
) -> None:
    wide = np.tile(RED, (1, 4, 1))
    options = {"gap": 4, "background": (background,) * 3}
    sheet = contact_sheet([[wide, wide]], [["frame 30", ""]], **options)
    np.testing.assert_array_equal(sheet[4:14, 4:84], wide)
    left, right = sheet[14:-4, 4:84], sheet[14:-4, 88:168]
    assert np.abs(left - ink).min() < 0.05
    assert (right == background).all()
    assert (sheet[:, 84:88] == background).all()


def test_a_caption_too_long_is_cut_to_its_cell() -> None:
    long = contact_sheet([[RED, RED]], [["a very long caption indeed", "b"]])
    assert long.shape[1] == contact_sheet([[RED, RED]]).shape[1]


@pytest.mark.parametrize(
    ("images", "captions"),
    [([], None), ([[None]], None), ([[RED]], [["a", "b"]]), ([[RED]], [])],
)
def test_sheets_that_do_not_add_up_are_refused(images, captions) -> None:
    with pytest.raises(OptionError, match="contact sheet"):
        contact_sheet(images, captions)


def test_pictures_with_alpha_are_refused() -> None:
    with pytest.raises(ShapeError, match="contact sheet"):
        contact_sheet([[np.zeros((4, 4, 4))]])
