import torch
from displacement import (
    STEEPEST,
    random_displacement,
    random_speeds,
    sampled,
    sources,
)
from torch import Generator


def fields(speed: float, uneven: float = 1.0) -> torch.Tensor:
    random = Generator().manual_seed(0)
    return random_displacement(torch.full((24, 1, 1), speed), 64, random, uneven=uneven)


def test_fields_have_the_speed_asked_for() -> None:
    for speed in (0.0, 0.3, 12.0):
        found = fields(speed).square().sum(dim=1).mean(dim=(1, 2)).sqrt()
        torch.testing.assert_close(found, torch.full((24,), speed), atol=1e-4, rtol=1e-3)


def test_nothing_folds_over_however_fast() -> None:
    flow = fields(12.0)
    assert flow.diff(dim=2).abs().max() <= STEEPEST * 1.001
    assert flow.diff(dim=3).abs().max() <= STEEPEST * 1.001


def test_some_fields_turn_and_some_only_shift() -> None:
    spread = fields(2.0).std(dim=(2, 3)).sum(dim=1)
    assert (spread < 1e-3).any()
    assert (spread > 1).any()
    assert (fields(2.0, uneven=0.0).std(dim=(2, 3)) < 1e-3).all()


def test_speeds_reach_from_still_to_fast() -> None:
    speeds = random_speeds(2000, Generator().manual_seed(0)).flatten()
    assert 0.04 < (speeds == 0).float().mean() < 0.13
    assert 0.1 <= speeds[speeds > 0].min() < 0.12
    assert 10 < speeds.max() <= 12


def test_going_to_the_source_and_along_the_field_leads_back() -> None:
    flow = fields(6.0)
    back = sources(flow)
    there_and_back = back + sampled(flow, back)
    assert there_and_back.abs().mean() < 0.01
