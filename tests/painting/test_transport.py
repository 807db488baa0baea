"""What goes from frame to frame travels with the smoke."""

from dataclasses import replace

import numpy as np
import pytest

from vnca.core import Box
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.painting import Roll, RollState, StylizeConfig
from vnca.painting.transport import transported
from vnca.rule import Rule, RuleConfig, Scales

BOX = Box((-20, -20, -20), (20, 20, 20))


def turning(frame: int = 0, *, speed: float = 0.2) -> Volume:
    """A slab of smoke in 24×24×3 cells that turns about its middle, `speed` radians a frame."""
    x, y, z = np.meshgrid(np.arange(24) - 11.5, np.arange(24) - 11.5, np.arange(3), indexing="ij")
    density = (np.hypot(x, y) < 11).astype(np.float32)
    velocity = np.stack([-y, x, 0 * z], axis=-1).astype(np.float32) * speed
    return Volume(density, velocity, (-12, -12, 0), np.eye(4), frame)


def angle_at(cells: np.ndarray) -> np.ndarray:
    """Direction `[n, 2]` from the middle."""
    at = cells[:, :2] + 0.5
    return at / np.linalg.norm(at, axis=1, keepdims=True)


@pytest.mark.parametrize(("frames", "off"), [(1.0, 0.02), (-1.0, 0.02), (2.0, 0.06)])
def test_a_pattern_turns_with_the_smoke(frames: float, off: float) -> None:
    smoke = turning()
    domain = Domain.around_smoke(smoke.density_field, threshold=0.5, dilation=0, box=BOX)
    state = np.zeros((len(domain) + 1, 2), np.float32)
    state[:-1] = angle_at(domain.cells)
    assert smoke.velocity_field is not None
    carried = transported(state, domain, domain, smoke.velocity_field, frames)[:-1]
    turn = -0.2 * frames
    back = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    expected = angle_at(domain.cells) @ back.T
    radius = np.linalg.norm(domain.cells[:, :2] + 0.5, axis=1)
    inside = (radius > 3) & (radius < 8)
    np.testing.assert_allclose(carried[inside], expected[inside], atol=off)


def still_rule(*, transport: bool) -> Rule:
    """One that never changes a state."""
    rule = Rule.initial(RuleConfig(channels=4, hidden=3, transport=transport), Scales(), seed=0)
    return replace(rule, output=np.zeros_like(rule.output))


def painted(config: StylizeConfig, *, transport: bool, frame: int = 1) -> np.ndarray:
    roll = Roll(still_rule(transport=transport), config, BOX)
    domain = Domain.around_smoke(
        turning().density_field, threshold=0.01, dilation=1, box=BOX.grown(1)
    )
    values = np.zeros((len(domain) + 1, 4), np.float32)
    values[:-1, 0] = 0.3 * angle_at(domain.cells)[:, 0]
    state = RollState(domain.cells, values, 10, frame=0)
    return roll.paint(turning(frame), state).state.values[:, 0]


def test_it_is_as_fast_as_asked_for_or_as_was_taught() -> None:
    stood = painted(StylizeConfig(), transport=False)
    along = painted(StylizeConfig(), transport=True)
    np.testing.assert_array_equal(painted(StylizeConfig(pattern_speed=0), transport=True), stood)
    np.testing.assert_array_equal(painted(StylizeConfig(pattern_speed=1), transport=False), along)
    ahead = painted(StylizeConfig(pattern_speed=2), transport=True)
    assert np.abs(along - stood).max() > 0.05
    assert np.abs(ahead - stood).sum() > 1.7 * np.abs(along - stood).sum()


def test_frames_that_are_left_out_are_made_up_for() -> None:
    skipped = painted(StylizeConfig(), transport=True, frame=2)
    np.testing.assert_array_equal(
        skipped, painted(StylizeConfig(pattern_speed=2), transport=True, frame=1)
    )


def test_without_velocity_it_stands() -> None:
    smoke = replace(turning(1), velocity=None)
    roll = Roll(still_rule(transport=True), StylizeConfig(), BOX)
    state = roll.paint(smoke, roll.start()).state
    again = roll.paint(smoke, state).state
    np.testing.assert_array_equal(again.values, state.values)


@pytest.mark.parametrize("speed", [float("nan"), 9.0, float("-inf")])
def test_a_speed_that_cannot_be_is_refused(speed: float) -> None:
    with pytest.raises(OptionError, match="pattern_speed"):
        StylizeConfig(pattern_speed=speed)
