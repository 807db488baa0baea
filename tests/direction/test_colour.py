"""Palettes, grading and fire."""

from pathlib import Path

import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.core.colour import luminance, srgb_to_linear
from vnca.core.errors import OptionError
from vnca.direction.colour import Editing
from vnca.direction.colour.fire import COOLEST, WHITE_HOT, emission
from vnca.direction.colour.grading import graded
from vnca.direction.colour.oklab import from_oklab, oklab
from vnca.direction.colour.palette import Matching, Recolouring, main_colours
from vnca.io.picture import write_image

SAME = {"hue": 0.0, "saturation": 1.0, "lightness": 0.0, "exposure": 0.0}


@pytest.fixture
def colours() -> FloatArray:
    return np.random.default_rng(0).random((500, 3)).astype(np.float32)


@pytest.fixture
def picture() -> FloatArray:
    """Three even colours, of which the first takes half of the picture."""
    paint = srgb_to_linear(np.array([[0.8, 0.3, 0.2], [0.2, 0.5, 0.3], [0.2, 0.3, 0.8]]))
    picture = paint[np.repeat([0, 0, 1, 2], 8)][:, None].repeat(32, axis=1)
    noise = np.random.default_rng(0).normal(0, 0.01, picture.shape)
    return (picture + noise).clip(0, 1).astype(np.float32)


def test_oklab_and_back_is_nothing(colours: FloatArray) -> None:
    np.testing.assert_allclose(from_oklab(oklab(colours)), colours, atol=1e-12)
    np.testing.assert_allclose(oklab(np.ones(3)), [1, 0, 0], atol=1e-6)


def test_no_change_is_none_to_the_bit(colours: FloatArray) -> None:
    np.testing.assert_array_equal(graded(colours, **SAME), colours)
    hue = np.zeros(len(colours), np.float32)
    hue[::2] = 90
    turned = graded(colours, **{**SAME, "hue": hue})  # type: ignore[arg-type]
    np.testing.assert_array_equal(turned[1::2], colours[1::2])
    assert np.abs(turned[::2] - colours[::2]).max() > 0.1


def test_each_control_does_what_it_says(colours: FloatArray) -> None:
    dull = 0.4 + 0.05 * colours
    grey = graded(dull, **{**SAME, "saturation": 0.0})
    np.testing.assert_allclose(grey, grey[:, :1].repeat(3, axis=1), atol=1e-5)
    np.testing.assert_allclose(oklab(grey)[:, 0], oklab(dull)[:, 0], atol=1e-5)
    lighter = graded(dull, **{**SAME, "lightness": 0.1})
    np.testing.assert_allclose(oklab(lighter)[:, 0], oklab(dull)[:, 0] + 0.1, atol=1e-4)
    np.testing.assert_allclose(graded(dull, **{**SAME, "exposure": 1.0}), 2 * dull)
    turned = oklab(graded(dull, **{**SAME, "hue": 180.0}))
    np.testing.assert_allclose(turned[:, 1:], -oklab(dull)[:, 1:], atol=1e-5)


def test_main_colours_are_those_of_the_picture(picture: FloatArray) -> None:
    found = main_colours(picture, 3)
    np.testing.assert_allclose(
        from_oklab(found)[0], srgb_to_linear(np.array([0.8, 0.3, 0.2])), atol=0.01
    )
    np.testing.assert_array_equal(found, main_colours(picture, 3))
    assert len(main_colours(np.full((4, 4, 3), 0.5), 5)) == 1


def test_a_main_colour_becomes_the_new_one_and_others_stay(picture: FloatArray) -> None:
    old = main_colours(picture, 3)
    new = old.copy()
    new[0] = oklab(np.array([0.1, 0.1, 0.4]))
    change = Recolouring(old, new)
    np.testing.assert_allclose(oklab(change.of(from_oklab(old))), new, atol=1e-5)
    near = change.of(from_oklab(old[:1] + np.array([0.0, 0.01, 0.0])))
    assert np.linalg.norm(oklab(near) - new[0]) < 0.02


def test_a_matched_picture_has_the_others_colours(picture: FloatArray, colours: FloatArray) -> None:
    muted = 0.3 + 0.2 * colours
    matched = Matching.between(picture, muted).of(picture.reshape(-1, 3))
    ours, theirs = oklab(matched), oklab(muted)
    np.testing.assert_allclose(ours.mean(axis=0), theirs.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(np.cov(ours.T), np.cov(theirs.T), atol=2e-3)
    same = Matching.between(picture, picture).of(picture.reshape(-1, 3))
    np.testing.assert_allclose(same, picture.reshape(-1, 3), atol=1e-5)


def test_exchanges_are_by_colour_or_number(picture: FloatArray, tmp_path: Path) -> None:
    red, blue = srgb_to_linear(np.array([[0.8, 0.3, 0.2], [0.2, 0.3, 0.8]])).astype(np.float32)
    for old in ("1", "#cc4d33"):
        changed = Editing.asked((f"{old}=#ffffff",), None, picture).of(np.stack([red, blue]))
        assert changed[0].min() > 0.9
        np.testing.assert_allclose(changed[1], blue, atol=0.05)
    write_image(tmp_path / "other.png", 0.5 * picture)
    darker = Editing.asked((), tmp_path / "other.png", picture).of(red[None])
    assert luminance(darker)[0] < 0.7 * luminance(red)
    with pytest.raises(
        OptionError, match=r"`recolour` '9=#ffffff': the picture has main colours 1"
    ):
        Editing.asked(("9=#ffffff",), None, picture)
    with pytest.raises(OptionError, match="no picture"):
        Editing.asked((), tmp_path / "other.png", None)


def test_hot_smoke_glows_red_then_white(colours: FloatArray) -> None:
    kelvin = np.array([300, COOLEST - 1, 1000, WHITE_HOT, 6500], np.float32)
    light = emission(kelvin)
    assert not light[:2].any()
    assert (light[2:4, 0] > 2 * light[2:4, 1]).all()
    assert luminance(light[3]) == pytest.approx(1, rel=0.01)
    assert light[4].max() < 1.1 * light[4].min()
    assert (np.diff(luminance(light[1:])) > 0).all()
    np.testing.assert_allclose(emission(kelvin, 2.0), 2 * light)
