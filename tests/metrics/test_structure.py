"""Measures of structure, on pictures whose structure is known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vnca.core import AnyArray, FloatArray
from vnca.metrics.setup import Pair, Seen, Viewpoint
from vnca.metrics.structure import BINS, Likeness, StructureMetric, structure
from vnca.metrics.style import StyleMetric

SIZE = 128


def stripes(
    angle: float = 0.0, period: float = 10.0, bright: float = 0.5, size: int = SIZE
) -> FloatArray:
    """Bright stripes of a share of the period, on dark; they run along `angle`, degrees."""
    rows, columns = np.mgrid[:size, :size]
    turned = np.radians(angle)
    across = -np.sin(turned) * columns + np.cos(turned) * rows
    part = (across / period) % 1 < bright
    grey = gaussian_filter(0.05 + 0.6 * part, 0.7)
    return np.repeat(grey[..., None], 3, axis=-1).astype(np.float32)


def grain(size: int = SIZE, blur: float = 0.0, seed: int = 0) -> FloatArray:
    noise = np.random.default_rng(seed).uniform(0.05, 0.65, (size, size, 3))
    if blur:
        noise = gaussian_filter(noise, (blur, blur, 0), mode="wrap")
        noise = 0.35 + (noise - noise.mean()) * 0.17 / noise.std()
    return noise.clip(0, 1).astype(np.float32)


def shapes(seed: int, size: int = SIZE, side: int = 32) -> FloatArray:
    """Large squares of two colours."""
    coarse = np.random.default_rng(seed).random((size // side, size // side, 1)) < 0.5
    colours = np.where(coarse, [0.6, 0.4, 0.05], [0.05, 0.05, 0.4])
    return colours.repeat(side, 0).repeat(side, 1).astype(np.float32)


def seen(picture: AnyArray) -> Seen:
    whole = np.ones(picture.shape[:2], np.float32)
    return Seen(picture.astype(np.float32), whole, whole)


def likeness(picture: FloatArray, painted: FloatArray) -> Likeness:
    plain = np.full_like(painted, 0.214)
    pair = Pair(Viewpoint(0, 0), seen(painted), seen(plain))
    shorter = min(picture.shape[:2])
    found = StructureMetric(StyleMetric(picture, shorter)).likeness([pair])
    assert found is not None
    return found


@pytest.mark.parametrize("angle", [0, 30, 90, 135])
def test_stripes_are_lines_and_run_their_way(angle: float) -> None:
    found = structure(stripes(angle))
    assert found.lines > 0.9
    assert found.width == pytest.approx(5, rel=0.2)
    ways = np.arctan2(
        *(
            (found.directions * wave(2 * np.pi * (np.arange(BINS) + 0.5) / BINS)).sum()
            for wave in (np.sin, np.cos)
        )
    )
    # Rows count downwards.
    assert np.degrees(ways) / 2 % 180 == pytest.approx(angle, abs=6) or angle == 0
    assert found.directions.sum() == pytest.approx(1)


def test_grain_runs_no_way() -> None:
    found = structure(grain())
    assert found.lines < 0.5
    assert found.directions.max() < 2 / BINS


def test_narrow_bright_marks_are_told_from_narrow_dark_ones() -> None:
    bright, even, dark = (structure(stripes(bright=part)).contrast for part in (0.2, 0.5, 0.8))
    assert bright > even + 0.2
    assert dark < even - 0.2
    assert bright == pytest.approx(-structure(0.7 - stripes(bright=0.2)).contrast, abs=0.4)


def test_what_is_not_chosen_does_not_count() -> None:
    both = grain()
    both[:, 48:] = stripes()[:, 48:]
    where = np.zeros(both.shape[:2], dtype=bool)
    where[:, 64:] = True
    part, alone = structure(both, where), structure(stripes())
    assert part.lines == pytest.approx(alone.lines, abs=0.02)
    assert part.width == pytest.approx(alone.width, rel=0.1)
    assert structure(both).lines < part.lines


def test_a_flat_picture_has_no_structure() -> None:
    found = structure(np.full((64, 64, 3), 0.3, np.float32))
    assert (found.lines, found.width, found.contrast) == (0, 0, 0)
    assert found.directions == pytest.approx(np.full(BINS, 1 / BINS))


def test_more_of_the_picture_is_like_it() -> None:
    picture = stripes(20, size=2 * SIZE)
    found = likeness(picture, picture[-SIZE:, -SIZE:])
    assert abs(found.lines) < 0.05
    assert found.width == pytest.approx(0, abs=0.2)
    assert abs(found.contrast) < 0.1
    assert found.direction < 0.1
    assert found.patches > 0.9


def test_each_measure_sees_what_it_is_for() -> None:
    picture = stripes(size=2 * SIZE)
    assert likeness(picture, grain()).lines < -0.4
    wider = likeness(picture, stripes(period=20)).width
    assert wider == pytest.approx(1, abs=0.3)
    assert likeness(picture, stripes(90)).direction > 0.8
    narrow = stripes(bright=0.2, size=2 * SIZE)
    assert likeness(narrow, stripes(bright=0.8)).contrast < -0.4
    assert likeness(picture, grain()).patches < likeness(picture, stripes(period=9)).patches - 0.3


def test_large_shapes_are_seen_where_the_palette_is_right_all_the_same() -> None:
    picture = shapes(1, size=256, side=64)
    fine = shapes(2, side=2)
    small, large = (likeness(picture, painted).regions for painted in (fine, shapes(3, side=64)))
    assert small is not None
    assert large is not None
    assert small < 0.5
    assert large > 0.8


def test_views_that_show_too_little_say_nothing() -> None:
    picture = stripes()
    empty = np.zeros((64, 64), np.float32)
    nothing = Seen(empty[..., None].repeat(3, -1), empty, empty)
    pair = Pair(Viewpoint(0, 0), nothing, nothing)
    assert StructureMetric(StyleMetric(picture, SIZE)).likeness([pair]) is None


def test_smoke_that_is_smaller_than_regions_and_patches_is_measured_by_the_rest() -> None:
    picture = stripes()
    where = np.zeros((64, 64), np.float32)
    where[20:30, 20:30] = 1
    view = Seen(stripes(size=64) * where[..., None], where, where)
    plain = Seen(np.full((64, 64, 3), 0.214, np.float32) * where[..., None], where, where)
    pair = Pair(Viewpoint(0, 0), view, plain)
    found = StructureMetric(StyleMetric(picture, SIZE)).likeness([pair])
    assert found is not None
    assert found.regions is None
    assert np.isfinite([found.lines, found.contrast, found.direction, found.patches]).all()
