"""States beyond ±1 are pulled back."""

import pytest
import torch

from vnca.losses.overflow import overflow


def test_states_within_the_range_cost_nothing() -> None:
    assert overflow(torch.tensor([[-1.0, 0.0, 1.0]])).item() == 0


def test_the_excess_is_averaged() -> None:
    assert overflow(torch.tensor([[3.0, -1.5], [0.0, 0.5]])).item() == pytest.approx(2.5 / 4)


def test_gradient_points_back_into_the_range() -> None:
    state = torch.tensor([2.0, -2.0, 0.5], requires_grad=True)
    overflow(state).backward()
    assert state.grad is not None
    torch.testing.assert_close(state.grad, torch.tensor([1.0, -1.0, 0.0]) / 3)
