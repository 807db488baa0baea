"""How near views come to the style picture, by measures and by networks."""

import dataclasses

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vnca.core import FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.features import load_network
from vnca.metrics.setup import Coloured, Pair, Seen, Setup, Viewpoint
from vnca.metrics.style import StyleMetric
from vnca.metrics.style_score import SIDES, Judge, measure_style, score_style
from vnca.rule import Rule, RuleConfig, Scales

SIZE = 64
DISC = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 24


def rule(gamma: float = 5.0, paint: float = 0.05) -> Rule:
    """One that paints, no matter what."""
    config = RuleConfig(hidden=8, channels=6, steps_per_frame=4)
    untrained = Rule.initial(config, Scales(gamma=gamma), seed=0)
    output = np.random.default_rng(1).normal(0, paint, untrained.output.shape)
    return dataclasses.replace(untrained, output=output.astype(np.float32))


@pytest.fixture(scope="module")
def picture() -> FloatArray:
    random = np.random.default_rng(0)
    return random.uniform(0, 1, (64, 80, 3)).astype(np.float32) * np.float32([1, 0.6, 0.1])


def test_smoke_as_it_comes_closes_nothing(tiny_smoke: Volume, picture: FloatArray) -> None:
    setup, metric = Setup.around([tiny_smoke], rule(), 64), StyleMetric(picture, 64)
    plain = Coloured.plain(tiny_smoke)
    pairs = [setup.look_twice(plain, plain, viewpoint) for viewpoint in SIDES]
    found = score_style(metric, pairs)
    assert found is not None
    assert found.normalised_score == pytest.approx(0, abs=0.02)
    assert found.by_measure["palette"] == pytest.approx(0, abs=0.1)


def test_paint_of_the_right_colours_closes_more(tiny_smoke: Volume, picture: FloatArray) -> None:
    setup, metric = Setup.around([tiny_smoke], rule(), 64), StyleMetric(picture, 64)
    plain = Coloured.plain(tiny_smoke)
    random = np.random.default_rng(1)
    colour = picture.reshape(-1, 3)[random.integers(0, 64 * 80, tiny_smoke.density.shape)]
    painted = plain._replace(colour=colour)
    found = score_style(
        metric, [setup.look_twice(painted, plain, viewpoint) for viewpoint in SIDES]
    )
    assert found is not None
    assert found.normalised_score > 0.3
    assert found.by_measure["palette"] > 0.3
    assert 0 <= found.spread < 0.2


def test_a_sequence_is_looked_at_every_few_frames_and_at_its_end(
    tiny_smoke: Volume, picture: FloatArray
) -> None:
    frames = [dataclasses.replace(tiny_smoke, frame=number) for number in range(4)]
    found = measure_style(rule(), frames, picture, cells=24, size=96, every=2)
    assert found.viewpoints == SIDES * 2
    again = measure_style(rule(), frames, picture, cells=24, size=96, every=2)
    assert found.shares == again.shares


def test_a_finer_painting_is_compared_with_a_picture_half_as_large(
    tiny_smoke: Volume, picture: FloatArray
) -> None:
    setup = Setup.around([tiny_smoke], rule(), 64)
    fine = setup.refined(2)
    assert fine.scale == pytest.approx(setup.scale / 2)
    viewpoint = SIDES[1]
    plain = Coloured.plain(tiny_smoke)._replace(
        colour=np.ones((*tiny_smoke.density.shape, 3), np.float32)
    )
    finer = tiny_smoke.refined(2)
    also = Coloured(finer.density, np.ones((*finer.density.shape, 3), np.float32), finer.origin)
    pair = setup.look(plain, viewpoint), fine.look(also, viewpoint)
    assert np.abs(pair[0].opacity - pair[1].opacity).mean() < 0.02
    few = {"cells": 48, "size": 96}
    found = measure_style(rule(), [tiny_smoke], picture, **few, refine=2)
    assert found.shares != measure_style(rule(), [tiny_smoke], picture, **few).shares


def test_smoke_that_cannot_be_seen_is_refused(tiny_smoke: Volume, picture: FloatArray) -> None:
    with pytest.raises(GridError, match="opaque in no frame"):
        measure_style(rule(gamma=1e-3), [tiny_smoke], picture, cells=24, size=64)
    nothing = dataclasses.replace(tiny_smoke, density=np.zeros_like(tiny_smoke.density))
    with pytest.raises(GridError, match="no smoke in any frame"):
        measure_style(rule(), [nothing], picture, cells=24, size=64)


def test_plain_smoke_is_grey_and_its_shape_can_be_seen(tiny_smoke: Volume) -> None:
    setup = Setup.around([tiny_smoke], rule(), 64)
    seen = setup.look(Coloured.plain(tiny_smoke), SIDES[0]).over([0, 0, 0])
    np.testing.assert_allclose(seen.max(-1), seen.min(-1), atol=1e-6)
    assert seen[20:24, 32].mean() > 1.2 * seen[40:44, 32].mean()


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
    return Pair(Viewpoint(0.0, 0.0), seen(colour, opaque), seen(grey, opaque))


@pytest.fixture(scope="module")
def metric() -> StyleMetric:
    return StyleMetric(PICTURE, 96)


@pytest.fixture(params=["edges", "efficientnet"])
def judge(request: pytest.FixtureRequest, metric: StyleMetric) -> Judge:
    return Judge.of(load_network(request.param), False, metric, SIZE)


def test_more_of_the_style_closes_the_gap_and_other_colours_do_not(
    judge: Judge, metric: StyleMetric
) -> None:
    judge.look(1, [pair(PICTURE[:SIZE, :SIZE])], metric)
    judge.look(2, [pair(painting(1, (0.9, 0.8, 0.2)))], metric)
    judge.look(3, [pair(painting(1, (0.2, 0.9, 0.9)))], metric)
    judge.look(4, [pair(np.full((SIZE, SIZE, 3), 0.214, np.float32))], metric)
    assert judge.shares[1] > 0.7
    assert judge.shares[2] > 0.6
    assert judge.shares[3] < judge.shares[2] - 0.2
    assert judge.shares[4] == 0


def test_cut_outs_may_be_smaller_than_what_a_network_takes(
    judge: Judge, metric: StyleMetric
) -> None:
    small = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 8
    judge.look(1, [pair(painting(1, (0.9, 0.8, 0.2)), small)], metric)
    assert np.isfinite(judge.shares[1])


def test_views_without_opaque_smoke_say_nothing(judge: Judge, metric: StyleMetric) -> None:
    judge.look(1, [pair(PICTURE[:SIZE, :SIZE], np.zeros_like(DISC))], metric)
    assert not judge.shares
    judge = Judge("imagenet", None, "not installed")
    judge.look(1, [pair(PICTURE[:SIZE, :SIZE])], metric)
    assert not judge.shares
