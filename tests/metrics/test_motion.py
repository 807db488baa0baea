"""Motion of a painted texture, and the estimators that see it."""

import dataclasses
import sys

import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.core.errors import BackendUnavailableError, GridError
from vnca.core.volume import Volume
from vnca.metrics.motion import (
    dis,
    farneback,
    measure_carried_noise,
    measure_drift,
    measure_motion,
    ours,
    transport_ratio,
)
from vnca.rendering.march import sample
from vnca.rule import Rule, RuleConfig, Scales

SHAPE = (14, 14, 14)
EVERYWHERE = np.ones(SHAPE, dtype=bool)


def texture(shift: tuple[float, float, float] = (0, 0, 0)) -> FloatArray:
    at = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), -1) - np.array(shift)
    waves = np.array([[0.5, 0.2, 0.4], [-0.3, 0.5, 0.3], [0.2, -0.4, 0.5]])
    return np.sin(at @ waves).astype(np.float32)


def uniform(*velocity: float) -> FloatArray:
    return np.broadcast_to(np.float32(velocity), (*SHAPE, 3)).copy()


def test_a_texture_that_is_carried_changes_by_transport_alone() -> None:
    velocity = uniform(0.6, -0.3, 0.9)
    carried = texture((0.6, -0.3, 0.9))
    assert transport_ratio(texture(), carried, velocity, EVERYWHERE) < 0.15
    # whole cells need no interpolation
    carried = texture((1, 0, -2))
    assert transport_ratio(texture(), carried, uniform(1, 0, -2), EVERYWHERE) < 1e-5


def test_carrying_the_wrong_way_is_worse_than_standing_still() -> None:
    carried = texture((0.6, -0.3, 0.9))
    assert transport_ratio(texture(), carried, uniform(-0.6, 0.3, -0.9), EVERYWHERE) > 1.5


def test_boiling_is_not_transport() -> None:
    noise = np.random.default_rng(0).normal(size=(2, *SHAPE, 3)).astype(np.float32)
    assert transport_ratio(noise[0], noise[1], uniform(0.5, 0.5, 0.5), EVERYWHERE) > 0.7


def test_at_rest_everything_that_changes_is_not_transport() -> None:
    assert transport_ratio(texture(), texture((1, 0, 0)), uniform(0, 0, 0), EVERYWHERE) == 1
    assert transport_ratio(texture(), texture(), uniform(1, 0, 0), EVERYWHERE) == 1


def test_what_flows_in_from_outside_is_left_out() -> None:
    inside = EVERYWHERE.copy()
    inside[:7] = False
    before, after = texture(), texture((1, 0, 0))
    before[:7] = after[:7] = 1e6
    assert transport_ratio(before, after, uniform(1, 0, 0), inside) < 1e-5


def random_rule(**scales: float) -> Rule:
    rule = Rule.initial(RuleConfig(hidden=8, steps_per_frame=4), Scales(**scales), seed=1)
    output = np.random.default_rng(2).normal(size=rule.output.shape, scale=0.02)
    return dataclasses.replace(rule, output=output.astype(np.float32))


def test_an_estimator_that_sees_nothing_move_is_a_speed_off(tiny_smoke: Volume) -> None:
    measures = measure_motion(
        random_rule(gamma=3.0),
        tiny_smoke,
        {"blind": lambda before, _: np.zeros((*before.shape, 2), np.float32)},
        size=32,
        frames=1,
        warmup=4,
    )
    assert measures.direction["blind"] == pytest.approx(1, abs=1e-4)
    assert measures.magnitude["blind"] == pytest.approx(measures.speed, rel=1e-3)
    assert measures.transport > 0


def test_the_same_seed_measures_the_same(tiny_smoke: Volume) -> None:
    def shifted(before: FloatArray, after: FloatArray) -> FloatArray:
        return np.stack([after - before, before], -1)

    options = {"size": 32, "frames": 2, "warmup": 3}
    rule = random_rule(gamma=3.0)
    found = [
        measure_motion(rule, tiny_smoke, {"it": shifted}, **options, seed=seed)  # type: ignore[arg-type]
        for seed in (0, 0, 1)
    ]
    assert found[0] == found[1]
    assert found[0] != found[2]


@pytest.mark.parametrize(("velocity", "message"), [(None, "no velocity"), (0.0, "moves enough")])
def test_smoke_that_tells_nothing_of_motion_is_refused(
    tiny_smoke: Volume, velocity: float | None, message: str
) -> None:
    still = None if velocity is None else np.zeros((*tiny_smoke.density.shape, 3), np.float32)
    smoke = dataclasses.replace(tiny_smoke, velocity=still)
    with pytest.raises(GridError, match=message):
        measure_motion(random_rule(), smoke, {}, size=32, frames=1, warmup=1)


def test_sampling_agrees_with_the_grid() -> None:
    # transport_ratio rests on cell [i, j, k] being the point (i, j, k)
    field = torch.from_numpy(texture()[..., :1].copy())
    at = torch.tensor([[3.0, 5.0, 7.0]])
    assert sample(field, at)[0, 0] == pytest.approx(float(field[3, 5, 7, 0]), abs=1e-5)


def test_carried_noise_moves_by_transport_and_is_seen_to(tiny_smoke: Volume) -> None:
    velocity = np.zeros((*tiny_smoke.density.shape, 3), np.float32)
    velocity[..., 2] = 1.0
    smoke = dataclasses.replace(tiny_smoke, velocity=velocity)
    measures = measure_carried_noise(random_rule(gamma=3.0), smoke, {"dis": dis()}, size=64)
    assert measures.transport < 0.2
    assert measures.direction["dis"] < 0.5


def test_drifting_as_one_is_right_where_all_smoke_moves_alike(tiny_smoke: Volume) -> None:
    rule, velocity = random_rule(gamma=3.0), np.zeros((*tiny_smoke.density.shape, 3), np.float32)
    velocity[..., 2] = 1.0
    together = dataclasses.replace(tiny_smoke, velocity=velocity)
    assert measure_drift(rule, together, size=32) == pytest.approx((0, 0), abs=1e-4)
    velocity = velocity.copy()
    velocity[len(velocity) // 2 :] *= -1
    apart = dataclasses.replace(tiny_smoke, velocity=velocity)
    assert measure_drift(rule, apart, size=32)[0] > 0.5


def waves(right: float, down: float) -> FloatArray:
    """A pattern of many waves, moved."""
    y, x = np.mgrid[:64, :96].astype(np.float32) - np.float32([down, right]).reshape(2, 1, 1)
    random = np.random.default_rng(0)
    u, v, phase = random.uniform(-0.6, 0.6, 40), random.uniform(-0.6, 0.6, 40), np.arange(40)
    pattern = np.cos(u[:, None, None] * x + v[:, None, None] * y + phase[:, None, None]).sum(0)
    return np.clip(0.5 + 0.03 * pattern, 0, 1).astype(np.float32)


@pytest.mark.parametrize("estimator", [ours, dis, farneback])
@pytest.mark.parametrize("moved", [(2.0, 0.0), (0.0, 2.0), (-1.0, -1.0)])
def test_all_estimators_agree_on_what_is_right_and_down(estimator, moved) -> None:
    flow = estimator()(waves(0, 0), waves(*moved))
    assert flow.shape == (64, 96, 2)
    assert flow.dtype == np.float32
    np.testing.assert_allclose(flow[12:-12, 12:-12].mean((0, 1)), moved, atol=0.4)


@pytest.mark.parametrize("estimator", [dis, farneback])
def test_opencv_is_asked_for_by_the_extra_that_has_it(estimator, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(BackendUnavailableError, match=r"vnca\[evaluate\]"):
        estimator()
