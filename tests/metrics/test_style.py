import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vnca.core import BoolArray, FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError, ShapeError
from vnca.metrics.style import (
    StyleDistances,
    StyleMetric,
    mean_distances,
    normalised_score,
    perceived,
)

SIZE = 96
DISC: BoolArray = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 36


def painting(seed: int, grain: float, hue: tuple[float, float, float]) -> FloatArray:
    """Blobs in two colours, the same everywhere."""
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal((SIZE, SIZE)), grain)
    part = (np.tanh(noise / noise.std() * 2) * 0.5 + 0.5)[..., None]
    return srgb_to_linear(part * np.float32(hue) + (1 - part) * np.float32([0.1, 0.1, 0.3])).astype(
        np.float32
    )


BLOBS = painting(0, 1.5, (0.9, 0.8, 0.2))
GREY = np.full((SIZE, SIZE, 3), 0.214, np.float32)


@pytest.fixture(scope="module")
def metric() -> StyleMetric:
    return StyleMetric(BLOBS, SIZE)


@pytest.fixture(scope="module")
def cutout(metric: StyleMetric) -> StyleDistances:
    return mean_distances(metric.distances(*part) for part in metric.cutouts(DISC, 3))


def closed(metric: StyleMetric, cutout: StyleDistances, picture: FloatArray) -> float:
    plain = metric.distances(GREY, DISC)
    return normalised_score(metric.distances(picture, DISC), plain, cutout)


def test_the_picture_itself_closes_the_gap_and_plain_grey_none_of_it(metric, cutout) -> None:
    assert metric.distances(BLOBS, np.ones_like(DISC)) == pytest.approx((0, 0, 0), abs=1e-5)
    assert closed(metric, cutout, BLOBS) > 0.9
    assert closed(metric, cutout, GREY) == 0


def test_another_sample_of_the_style_closes_it_and_other_styles_do_not(metric, cutout) -> None:
    assert closed(metric, cutout, painting(1, 1.5, (0.9, 0.8, 0.2))) > 0.85
    assert closed(metric, cutout, painting(1, 1.5, (0.2, 0.9, 0.9))) < 0.6
    assert closed(metric, cutout, painting(1, 4.0, (0.9, 0.8, 0.2))) < 0.7


def test_each_measure_sees_what_it_is_for(metric) -> None:
    shuffled = np.random.default_rng(0).permutation(BLOBS.reshape(-1, 3)).reshape(BLOBS.shape)
    scattered = metric.distances(shuffled, DISC)
    assert scattered.palette < 0.1
    assert scattered.texture > 0.5
    assert scattered.spectrum > 0.5
    tinted = metric.distances(BLOBS[..., ::-1].copy(), DISC)
    assert tinted.palette > 0.3
    assert tinted.spectrum < 0.3


def test_what_lies_outside_the_smoke_is_of_no_effect_on_colour_and_texture(metric) -> None:
    beside = np.where(DISC[..., None], BLOBS, np.float32(5.0))
    assert metric.distances(beside, DISC)[:2] == pytest.approx(metric.distances(BLOBS, DISC)[:2])
    spectra = (metric.distances(picture, DISC).spectrum for picture in (beside, BLOBS))
    assert next(spectra) == pytest.approx(next(spectra), abs=1e-5)


def test_cutouts_are_parts_of_the_picture_in_the_shape_of_the_smoke(metric) -> None:
    shape = np.zeros((200, 300), bool)
    shape[50:80, 100:110] = shape[70:80, 100:140] = True
    parts = list(metric.cutouts(shape, 6))
    assert len(parts) == 6
    for picture, where in parts:
        assert picture.shape[:2] == where.shape == (30, 40)
        assert where.sum() == shape.sum()
        assert (picture[..., None, None, :] >= 0).all()
    assert any(not np.array_equal(parts[0][0], picture) for picture, _ in parts)
    # a shape larger than the picture is cut
    ((picture, where),) = metric.cutouts(np.ones((500, 40), bool), 1)
    assert picture.shape[:2] == where.shape == (SIZE, 40)


def test_a_wisp_is_measured_by_what_can_be_seen_of_it(metric) -> None:
    wisp = np.zeros_like(DISC)
    wisp[40:44, 20:60] = True
    distances = metric.distances(BLOBS, wisp)
    assert distances.texture == 0
    assert np.isfinite(distances).all()


def test_colours_are_those_of_oklab_with_doubled_chroma() -> None:
    lab = perceived(np.float32([[1, 1, 1], [1, 0, 0], [0, 0, 0]]))
    expected = [[1, 0, 0], [0.628, 2 * 0.2249, 2 * 0.1258], [0, 0, 0]]
    np.testing.assert_allclose(lab, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("picture", "shorter", "error"),
    [(np.zeros((90, 90), np.float32), 96, ShapeError), (BLOBS, 40, OptionError)],
)
def test_what_is_no_style_picture_is_refused(picture, shorter, error) -> None:
    with pytest.raises(error, match="style picture"):
        StyleMetric(picture, shorter)


def test_being_nearer_than_the_picture_is_makes_up_for_nothing() -> None:
    assert normalised_score((0.0, 0.6), (1.0, 1.0), (0.2, 0.2)) == pytest.approx(0.75)
    assert normalised_score((1.8,), (1.0,), (0.2,)) == pytest.approx(-1)
    assert normalised_score((0.1,), (0.2,), (0.2,)) == 1
    assert normalised_score((0.3,), (0.2,), (0.2,)) == 0
