"""How wide strokes are found to be, and how large a picture is shown for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core import FloatArray
from vnca.features.strokes import COARSEST, FINEST, picture_cells, stroke_width

SIZE = 128
DARK, BRIGHT = (0.05, 0.1, 0.2), (0.9, 0.7, 0.3)


def stripes(
    width: float,
    angle: float = 0.0,
    colours: tuple[tuple[float, float, float], ...] = (DARK, BRIGHT),
    size: tuple[int, int] = (SIZE, SIZE),
) -> FloatArray:
    """Stripes of two colours, each so many pixels wide; smooth where they meet."""
    rows, columns = np.mgrid[: size[0], : size[1]]
    across = columns * np.cos(angle) + rows * np.sin(angle)
    part = np.clip(0.5 + width * np.sin(np.pi * across / width) / 2, 0, 1)[..., None]
    one, other = np.float32(colours)
    return (part * one + (1 - part) * other).astype(np.float32)


@settings(max_examples=12, deadline=None)
@given(width=st.floats(4, 12), angle=st.floats(0, np.pi))
def test_stripes_are_as_wide_as_they_are_whatever_their_direction(
    width: float, angle: float
) -> None:
    found = stroke_width(stripes(width, angle))
    assert found is not None
    assert found * SIZE == pytest.approx(width, rel=0.15)


def test_colour_alone_is_enough() -> None:
    red_and_green = ((0.5, 0.0, 0.0), (0.0, 0.14, 0.0))  # about as bright
    found = stroke_width(stripes(6, colours=red_and_green))
    assert found is not None
    assert found * SIZE == pytest.approx(6, rel=0.15)


def test_contrast_does_not_matter_and_faint_grain_neither() -> None:
    faint = ((0.2, 0.2, 0.2), (0.25, 0.25, 0.25))
    grain = np.random.default_rng(0).normal(0, 0.004, (SIZE, SIZE, 3)).astype(np.float32)
    for picture in (stripes(6, colours=faint), stripes(6) + grain):
        found = stroke_width(picture)
        assert found is not None
        assert found * SIZE == pytest.approx(6, rel=0.2)


def test_width_is_relative_to_the_shorter_side_at_any_resolution() -> None:
    small, large = stripes(4, size=(96, 144)), stripes(16, size=(384, 576))
    found = stroke_width(small), stroke_width(large)
    assert None not in found
    assert found == pytest.approx((4 / 96, 4 / 96), rel=0.15)


def test_wide_strokes_among_fine_ones_count_for_the_area_they_cover() -> None:
    both = stripes(3)
    both[:, SIZE // 2 :] = stripes(12)[:, SIZE // 2 :]
    found = stroke_width(both)
    assert found is not None
    assert 4 < found * SIZE < 10


def test_a_flat_picture_has_no_strokes_and_fills_a_view() -> None:
    flat = np.full((64, 64, 3), 0.3, np.float32)
    assert stroke_width(flat) is None
    assert picture_cells(flat, cells=50.0, pixels=96) == 50


def test_strokes_span_three_cells_where_cells_are_seen_finely() -> None:
    cells = picture_cells(stripes(5), cells=32.0, pixels=128)
    assert 5 / SIZE * cells == pytest.approx(3, rel=0.15)


def test_strokes_that_a_decoder_draws_span_two_cells_and_their_picture_fills_a_view() -> None:
    cells = picture_cells(stripes(5), cells=32.0, pixels=128, drawn=True)
    assert 5 / SIZE * cells == pytest.approx(2, rel=0.15)
    assert picture_cells(stripes(24), cells=60.0, pixels=240, drawn=True) == 60


@pytest.mark.parametrize("across", [64.0, 400.0])
def test_strokes_span_four_pixels_where_they_are_not(across: float) -> None:
    cells = picture_cells(stripes(5), cells=across, pixels=64)
    assert 5 / SIZE * cells * 64 / across == pytest.approx(4, rel=0.15)


def test_extremes_are_bounded() -> None:
    assert picture_cells(stripes(2.5), cells=32.0, pixels=128) == pytest.approx(3 / FINEST)
    assert picture_cells(stripes(24), cells=32.0, pixels=128) == pytest.approx(3 / COARSEST)


def test_a_picture_with_values_beyond_its_range_gives_a_number() -> None:
    wild = stripes(5) * 40 - 3
    assert np.isfinite(picture_cells(wild, cells=64.0, pixels=96))
