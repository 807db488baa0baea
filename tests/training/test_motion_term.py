import math
from dataclasses import replace

import pytest
import torch
from torch.nn import functional

from vnca.features.flow import FlowNetwork
from vnca.losses import Motion, MotionConfig
from vnca.training import Snapshot
from vnca.training.terms import MotionSupervision, _shrunk

CONFIG = MotionConfig(weight=0.5, balance_over=3)


@pytest.fixture(scope="module")
def network() -> FlowNetwork:
    return FlowNetwork.load()


@pytest.fixture
def supervision(network: FlowNetwork) -> MotionSupervision:
    return MotionSupervision(CONFIG, network)


def texture(shift: float = 0.0, size: int = 64) -> torch.Tensor:
    """A smooth sRGB picture `[1, 3, r, c]`, moved to the right by 64ths of its width."""
    at = torch.arange(size) * (64 / size)
    row, column = torch.meshgrid(at, at - shift, indexing="ij")
    waves = [(0.5, 0.3), (-0.4, 0.6), (0.2, -0.7), (0.8, 0.1)]
    grey = 0.5 + 0.1 * torch.stack([torch.sin(a * row + b * column) for a, b in waves]).sum(0)
    return grey.expand(1, 3, size, size)


def rightwards(speed: float) -> torch.Tensor:
    return torch.tensor([speed, 0.0]).expand(64, 64, 2)


@pytest.mark.parametrize("frames", [0.5, 1.0, 2.0])
def test_a_rollout_of_n_of_n_steps_shows_that_part_of_a_frames_motion(
    supervision: MotionSupervision, frames: float
) -> None:
    after = texture(1.5 * frames)
    opaque = torch.ones(64, 64)
    motion = supervision.compare(texture(), after, rightwards(1.5), opaque, frames=frames)
    assert motion.direction < 0.1
    assert motion.magnitude < 0.5
    against = supervision.compare(texture(), after, rightwards(-1.5), opaque, frames=frames)
    assert against.direction > 1.5


def test_pictures_may_be_larger_than_what_motion_is_looked_for_in(
    supervision: MotionSupervision,
) -> None:
    before, after = texture(size=96), texture(1.5, size=96)
    opaque = torch.ones(64, 64)
    motion = supervision.compare(before, after, rightwards(1.5), opaque, frames=1)
    assert motion.direction < 0.1


def test_the_gradient_reaches_the_picture_and_is_finite(supervision: MotionSupervision) -> None:
    after = texture().clone().requires_grad_()
    motion = supervision.compare(texture(), after, rightwards(1.0), torch.ones(64, 64), frames=1)
    supervision.weighted(motion, 2.0).backward()
    assert after.grad is not None
    assert after.grad.isfinite().all()
    assert after.grad.any()


def test_the_weight_follows_the_median_appearance_loss(supervision: MotionSupervision) -> None:
    wrong = Motion(torch.tensor(1.0), torch.tensor(0.0))
    weights = [float(supervision.weighted(wrong, loss)) for loss in (4, 8, 100, 9, 10)]
    assert weights == [2, 3, 4, 4.5, 5]
    absolute = MotionSupervision(replace(CONFIG, balance_over=0), supervision._network)
    assert float(absolute.weighted(wrong, 100.0)) == 0.5


def test_a_loss_that_is_not_finite_does_not_enter_the_balance(
    supervision: MotionSupervision,
) -> None:
    wrong = Motion(torch.tensor(1.0), torch.tensor(0.0))
    supervision.weighted(wrong, 4.0)
    assert float(supervision.weighted(wrong, math.nan)) == 2


def test_a_snapshot_goes_on_with_the_same_balance(supervision: MotionSupervision) -> None:
    wrong = Motion(torch.tensor(1.0), torch.tensor(0.0))
    for loss in (4.0, 8.0, 6.0):
        supervision.weighted(wrong, loss)
    other = MotionSupervision(CONFIG, supervision._network)
    other.restore(supervision.snapshot())
    assert float(other.weighted(wrong, 1.0)) == float(supervision.weighted(wrong, 1.0))
    with pytest.raises(ValueError, match="finite"):
        other.restore(Snapshot(values={"appearance": [math.inf]}))


@pytest.mark.parametrize(("many", "few"), [(128, 96), (96, 48), (50, 33), (32, 32)])
def test_a_shrunk_pixel_is_the_mean_of_the_area_it_covers(many: int, few: int) -> None:
    pictures = torch.rand(2, many, many, generator=torch.Generator().manual_seed(many))
    shrunk = _shrunk(pictures, few)
    torch.testing.assert_close(shrunk.mean((1, 2)), pictures.mean((1, 2)))
    flat = torch.full((1, many, many), 0.7)
    torch.testing.assert_close(_shrunk(flat, few), torch.full((1, few, few), 0.7))
    if many % few == 0:
        blocks = functional.avg_pool2d(pictures, many // few)
        torch.testing.assert_close(shrunk, blocks)
