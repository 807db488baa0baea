import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vnca.core import Box, FloatArray
from vnca.metrics.coherence import LONG, Coherence, around, disagreement, mean_agreement
from vnca.metrics.setup import Coloured, Pair, Seen, Setup, Viewpoint

FRONT = Viewpoint(0, 0)


def picture(seed: int, moved: int = 0) -> Seen:
    """A smooth pattern, all opaque, that has moved to the right."""
    noise = np.random.default_rng(seed).standard_normal((48, 48, 3))
    colour = np.roll(gaussian_filter(noise, (2, 2, 0), mode="wrap"), moved, axis=1)
    colour = (0.5 + colour).clip(0.05, 1).astype(np.float32)
    return Seen(colour, np.ones((48, 48), np.float32), np.zeros((48, 48), np.float32))


def right(pixels: float) -> FloatArray:
    return np.broadcast_to(np.float32([pixels, 0]), (48, 48, 2)).copy()


def still(before: FloatArray, _after: FloatArray) -> FloatArray:
    return np.zeros((*before.shape, 2), np.float32)


def filmed(painted: list[Seen], plain: list[Seen], flow: FloatArray | None) -> Coherence:
    coherence = Coherence(still)
    for number, pair in enumerate(zip(painted, plain, strict=True)):
        coherence.add(number, Pair(FRONT, *pair), flow)
    return coherence


def test_paint_that_is_carried_agrees_and_paint_that_stands_still_does_not() -> None:
    carried = [picture(0, 2 * frame) for frame in range(LONG + 2)]
    standing = [picture(0)] * len(carried)
    steps = filmed(standing, carried, right(2)).steps
    assert len(steps) == LONG + 1
    for error in (steps[0].short, steps[-1].long):
        assert error is not None
        assert error.plain == pytest.approx(0, abs=1e-3)
        assert error.painted > 0.3
        assert error.unmoved == 0
    assert steps[0].long is None
    assert filmed(carried, carried, right(2)).difference == pytest.approx(0, abs=1e-3)
    difference = filmed(standing, carried, right(2)).difference
    assert difference is not None
    assert difference.max() > 0.05


def test_a_warp_follows_the_velocity_between_pixels_and_down() -> None:
    blobs = picture(0).colour
    down = np.roll(blobs, 3, axis=0)
    flow = np.broadcast_to(np.float32([0, 3]), (48, 48, 2)).copy()
    frames = [
        Seen(colour, np.ones((48, 48), np.float32), blobs[..., 0]) for colour in (blobs, down)
    ]
    (step,) = filmed(frames, frames, flow).steps
    assert step.short is not None
    assert step.short.painted == pytest.approx(0, abs=1e-3)
    assert step.short.unmoved > 0.5


def test_without_velocity_or_without_the_next_frame_nothing_is_warped() -> None:
    frames = [picture(0), picture(0)]
    (step,) = filmed(frames, frames, None).steps
    assert step.short is None
    assert step.flow == 0
    coherence = Coherence(still)
    for number in (1, 3):
        coherence.add(number, Pair(FRONT, *frames), right(0))
    assert coherence.steps == ()
    assert coherence.difference is None


def test_flows_differ_by_as_much_as_is_seen() -> None:
    def seen(before: FloatArray, _after: FloatArray) -> FloatArray:
        return np.full((*before.shape, 2), 3.0 if before.mean() > 0.95 else 0.0, np.float32)

    bright = Seen(*(np.ones_like(part) for part in vars(picture(0)).values()))
    coherence = Coherence(seen)
    for number in (1, 2):
        coherence.add(number, Pair(FRONT, bright, picture(0)), None)
    assert coherence.steps[0].flow == pytest.approx(3 * np.sqrt(2))


def test_unrelated_pixels_disagree_by_one_and_equal_ones_not_at_all() -> None:
    a, b = np.random.default_rng(0).normal(0.5, 0.2, (2, 20000, 3))
    assert disagreement(a, b) == pytest.approx(1, abs=0.02)
    assert disagreement(a, a) == 0
    flat = np.full((100, 3), 0.3)
    assert disagreement(flat, flat) == 0


def test_colours_in_the_volume_agree_from_side_to_side_and_colours_of_a_view_do_not() -> None:
    at = np.stack(np.meshgrid(*[np.arange(20) - 9.5] * 3, indexing="ij"), axis=-1)
    density = (np.linalg.norm(at, axis=-1) < 8).astype(np.float32)
    colour = (0.5 + 0.4 * np.sin(at * [0.7, 0.9, 0.8])).astype(np.float32)
    ball = Coloured(density, colour, (0, 0, 0))
    setup = Setup(Box((0, 0, 0), (20, 20, 20)), gamma=8.0, size=64)
    viewpoints = [Viewpoint(azimuth, 10) for azimuth in range(0, 360, 30)]
    fixed = [setup.look_twice(ball, ball, viewpoint) for viewpoint in viewpoints]
    agreement = around(setup, fixed)
    assert agreement is not None
    assert agreement.painted < 0.25
    assert agreement.ratio == 1
    wrong = [
        Pair(
            pair.viewpoint,
            Seen(first.painted.colour, pair.painted.opacity, pair.painted.depth),
            pair.plain,
        )
        for pair, first in zip(fixed, [fixed[0]] * len(fixed), strict=True)
    ]
    disagreeing = around(setup, wrong)
    assert disagreeing is not None
    assert disagreeing.painted > 1.5 * agreement.painted


def test_a_mean_of_nothing_is_nothing() -> None:
    assert mean_agreement([None, None]) is None
