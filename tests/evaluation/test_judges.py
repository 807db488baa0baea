"""Networks tell how near views come to the picture, whatever they were trained with."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vnca.colour import srgb_to_linear
from vnca.evaluation.judges import Judge
from vnca.evaluation.stage import Pair, Seen, Sight
from vnca.evaluation.style import StyleGauge
from vnca.features.load import load_network
from vnca.typing import FloatArray

SIZE = 64
DISC = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 24


def painting(seed: int, hue: tuple[float, float, float], size: int = SIZE) -> FloatArray:
    """Blobs in two colours, the same everywhere."""
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal((size, size)), 1.5)
    part = (np.tanh(noise / noise.std() * 2) * 0.5 + 0.5)[..., None]
    shown = part * np.float32(hue) + (1 - part) * np.float32([0.1, 0.1, 0.3])
    return srgb_to_linear(shown).astype(np.float32)


PICTURE = painting(0, (0.9, 0.8, 0.2), 96)


def seen(colour: FloatArray, opaque: np.ndarray = DISC) -> Seen:
    opacity = opaque.astype(np.float32)
    return Seen(colour * opacity[..., None], opacity, np.ones_like(opacity))


def pair(colour: FloatArray, opaque: np.ndarray = DISC) -> Pair:
    grey = np.full((SIZE, SIZE, 3), 0.214, np.float32)
    return Pair(Sight(0.0, 0.0), seen(colour, opaque), seen(grey, opaque))


@pytest.fixture(scope="module")
def gauge() -> StyleGauge:
    return StyleGauge(PICTURE, 96)


@pytest.fixture(params=["edges", "efficientnet"])
def judge(request: pytest.FixtureRequest, gauge: StyleGauge) -> Judge:
    return Judge.of(load_network(request.param), False, gauge, SIZE)


def test_more_of_the_style_closes_the_gap_and_other_colours_do_not(
    judge: Judge, gauge: StyleGauge
) -> None:
    judge.look(1, [pair(PICTURE[:SIZE, :SIZE])], gauge)
    judge.look(2, [pair(painting(1, (0.9, 0.8, 0.2)))], gauge)
    judge.look(3, [pair(painting(1, (0.2, 0.9, 0.9)))], gauge)
    judge.look(4, [pair(np.full((SIZE, SIZE, 3), 0.214, np.float32))], gauge)
    assert judge.shares[1] > 0.7
    assert judge.shares[2] > 0.6
    assert judge.shares[3] < judge.shares[2] - 0.2
    assert judge.shares[4] == 0


def test_cut_outs_may_be_smaller_than_what_a_network_takes(judge: Judge, gauge: StyleGauge) -> None:
    small = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 8
    judge.look(1, [pair(painting(1, (0.9, 0.8, 0.2)), small)], gauge)
    assert np.isfinite(judge.shares[1])


def test_views_without_opaque_smoke_say_nothing(judge: Judge, gauge: StyleGauge) -> None:
    judge.look(1, [pair(PICTURE[:SIZE, :SIZE], np.zeros_like(DISC))], gauge)
    assert not judge.shares
    judge = Judge("imagenet", None, "not installed")
    judge.look(1, [pair(PICTURE[:SIZE, :SIZE])], gauge)
    assert not judge.shares
