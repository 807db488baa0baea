"""What is said of the smoke on its way to a rule."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vnca.core.volume import Volume
from vnca.io import SmokeFormat
from vnca.painting.frames import PAIRS_CHECKED, VelocityCheck
from vnca.rule import Rule, RuleConfig, Scales

RULE = Rule.initial(RuleConfig(channels=4, hidden=3, transport=True), Scales(), seed=0)


def drifting(frame: int, *, times: float = 1.0) -> Volume:
    """A ball that moves by a cell a frame; `times` as fast as its velocity says."""
    at = np.stack(np.meshgrid(*[np.arange(24)] * 3, indexing="ij"), axis=-1) - 11.5
    density = np.exp(-((at - [frame - 3, 0, 0]) ** 2).sum(-1) / 12).astype(np.float32)
    velocity = np.zeros((*density.shape, 3), np.float32)
    velocity[..., 0] = 1 / times
    return Volume(density, velocity, (0, 0, 0), np.eye(4), frame)


def told(
    frames: list[Volume], *, rule: Rule = RULE, format: SmokeFormat | None = None
) -> list[str]:
    lines: list[str] = []
    check = VelocityCheck(rule, format or SmokeFormat(), lines.append)
    for smoke in frames:
        check.look(smoke, Path(f"smoke_{smoke.frame}.vdb"))
    return lines


@pytest.mark.parametrize(
    ("times", "words"), [(1 / 16, "times too fast"), (16, "times too slow"), (1, None)]
)
def test_velocity_in_other_units_is_told_once(times: float, words: str | None) -> None:
    lines = told([drifting(frame, times=times) for frame in range(5)])
    if words is None:
        assert lines == []
    else:
        (line,) = lines
        assert line.startswith("smoke_1.vdb: the velocity seems about ")
        assert words in line
        assert "`velocity_units`" in line


def test_frames_that_do_not_follow_on_each_other_tell_nothing() -> None:
    assert told([drifting(frame, times=16) for frame in (0, 2, 4)]) == []


def test_velocity_that_no_rule_uses_and_no_velocity_at_all() -> None:
    wrong = [drifting(frame, times=16) for frame in range(3)]
    deaf = RuleConfig(channels=4, hidden=3, velocity_prior=False)
    assert told(wrong, rule=Rule.initial(deaf, Scales(), seed=0)) == []
    assert told(wrong, format=SmokeFormat(velocity_grid="none")) == []


def test_no_frame_is_kept_longer_than_it_is_wanted() -> None:
    check = VelocityCheck(RULE, SmokeFormat(), lambda _: None)
    for frame in range(PAIRS_CHECKED + 1):
        check.look(drifting(frame), None)
    assert check._before is None
    check.look(replace(drifting(9), velocity=None, frame=9), None)
