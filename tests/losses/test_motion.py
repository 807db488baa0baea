import dataclasses

import pytest
import torch

from vnca.core.errors import OptionError
from vnca.losses import Motion, MotionConfig, compare_motion, motion_loss, supervised

CONFIG = MotionConfig()


def flow(right: float, down: float) -> torch.Tensor:
    return torch.tensor([right, down], dtype=torch.float32).expand(8, 6, 2).clone()


EVERYWHERE = torch.ones(8, 6, dtype=torch.bool)


@pytest.mark.parametrize(
    ("seen", "direction", "magnitude"),
    [
        ((2, 0), 0, 0),
        ((6, 0), 0, 4),
        ((0, 2), 1, 0),
        ((-1, 0), 2, 1),
        ((0, 0), 1, 2),
    ],
)
def test_direction_and_speed_of_known_flows(seen, direction, magnitude) -> None:
    motion = compare_motion(flow(*seen), flow(2, 0), EVERYWHERE)
    assert motion.direction == pytest.approx(direction, abs=1e-5)
    assert motion.magnitude == pytest.approx(magnitude, abs=1e-5)


def test_only_the_chosen_pixels_count() -> None:
    seen, target = flow(1, 0), flow(1, 0)
    seen[:4] = torch.tensor([0.0, 9.0])
    where = EVERYWHERE.clone()
    where[:4] = False
    assert compare_motion(seen, target, where).direction == pytest.approx(0, abs=1e-6)


def test_background_thin_smoke_and_smoke_at_rest_teach_nothing() -> None:
    target, opacity = flow(1, 0), torch.ones(8, 6)
    target[0] = 0.0
    opacity[1] = CONFIG.opacity_threshold
    where = supervised(target, opacity, CONFIG)
    assert where.sum() == 6 * 6
    assert not where[:2].any()


def test_nothing_to_compare_gives_zero_and_no_gradient() -> None:
    seen = flow(1, 0).requires_grad_()
    motion = compare_motion(seen, flow(0, 0), ~EVERYWHERE)
    loss = motion_loss(motion, CONFIG)
    loss.backward()
    assert loss == 0
    assert seen.grad is not None
    assert not seen.grad.any()


@pytest.mark.parametrize("seen", [(0.0, 0.0), (1e-20, 0.0), (3.0, 4.0)])
def test_gradients_are_finite_also_where_nothing_moves(seen) -> None:
    found = flow(*seen).requires_grad_()
    motion_loss(compare_motion(found, flow(1, 0), EVERYWHERE), CONFIG).backward()
    assert found.grad is not None
    assert found.grad.isfinite().all()


def test_speed_counts_only_as_far_as_the_direction_is_right() -> None:
    def of_speed(direction: float) -> float:
        far, near = (Motion(torch.tensor(direction), torch.tensor(m)) for m in (3.0, 0.0))
        return float(motion_loss(far, CONFIG) - motion_loss(near, CONFIG))

    assert of_speed(0.0) == pytest.approx(3)
    assert of_speed(0.5) == pytest.approx(1.5)
    assert of_speed(1.0) == of_speed(1.7) == 0


def test_descending_the_loss_turns_a_flow_to_its_target() -> None:
    found, target = flow(-1, 0.5).requires_grad_(), flow(2, 1)
    descent = torch.optim.Adam([found], lr=0.05)
    for _ in range(300):
        descent.zero_grad()
        motion_loss(compare_motion(found, target, EVERYWHERE), CONFIG).backward()
        descent.step()
    torch.testing.assert_close(found.detach(), target, atol=0.1, rtol=0)


@pytest.mark.parametrize(
    "bad",
    [
        {"weight": -1.0},
        {"direction": float("nan")},
        {"magnitude": float("inf")},
        {"slowest": -0.1},
        {"size": 16},
        {"opacity_threshold": 1.0},
        {"balance_over": -1},
    ],
)
def test_options_out_of_range_are_named(bad) -> None:
    with pytest.raises(OptionError, match=f"`motion.{next(iter(bad)).replace('_', '_')}` "):
        dataclasses.replace(CONFIG, **bad)
