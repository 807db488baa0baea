import dataclasses

import pytest
import torch

from vnca.peers import Clip, Look
from vnca.peers.lnst import LnstSettings, lnst, smoothed
from vnca.peers.particles import carried, reconstructed, sampled, spread
from vnca.peers.splat import splatted_mass

SETTINGS = LnstSettings(iterations=3, spreading=3)


def quiet(done: int, total: int, loss: float | None) -> None:
    pass


def test_particles_keep_their_numbers_and_follow_the_smoke(clip: Clip) -> None:
    particles = sampled(clip, 0, lambda done: None)
    counts = [len(at) for at in particles.positions]
    assert counts == sorted(counts)
    for before, after in zip(particles.positions, particles.positions[1:], strict=False):
        # All of the smoke rises by a cell a frame, and each particle with it.
        assert torch.allclose(
            after[: len(before)], before + torch.tensor([0.0, 0.0, 1.0]), atol=1e-4
        )
    assert particles.count == counts[0]


def test_particles_show_the_smoke_they_stand_for(clip: Clip) -> None:
    particles = sampled(clip, 5, lambda done: None)
    for at, density in zip(particles.positions, clip.density, strict=True):
        shown = reconstructed(at, density)[1]
        assert (shown - density).abs().sum() < 0.15 * density.sum()


def test_published_slips_let_smoke_grow_and_particles_leave_it(clip: Clip) -> None:
    mended, published = (
        sampled(clip, 5, lambda done: None, as_published=slips) for slips in (False, True)
    )
    assert published.count > 1.5 * mended.count
    at, density = mended.positions[0], clip.density[0]
    grown = reconstructed(at, density, always_full=True)[1].sum()
    assert grown > 1.2 * reconstructed(at, density)[1].sum()


def test_carrying_round_a_circle_comes_back() -> None:
    # Once around in 64 frames; Runge and Kutta's rule is exact to a hundredth of a cell.
    axis = torch.arange(24.0) - 11.5
    x, y = torch.meshgrid(axis, axis, indexing="ij")
    speed = 2 * torch.pi / 64
    flow = torch.stack([-speed * y, speed * x, torch.zeros_like(x)], -1)[:, :, None].expand(
        24, 24, 4, 3
    )
    start = torch.tensor([[17.5, 11.5, 1.0]])
    at = start
    for _ in range(64):
        at = carried(at, flow)
    assert torch.allclose(at, start, atol=0.02)


def test_spreading_makes_crowds_thinner() -> None:
    random = torch.Generator().manual_seed(0)
    crowd = 4 + 4 * torch.rand(200, 3, generator=random)
    before, after = (
        (splatted_mass(at, (12, 12, 12), 2.0) - 1).clamp_min(0).square().sum()
        for at in (crowd, spread(crowd, (12, 12, 12), 10))
    )
    assert after < 0.7 * before


def test_it_comes_nearer_to_the_picture(clip: Clip, look: Look) -> None:
    losses: list[float] = []

    def tell(done: int, total: int, loss: float | None) -> None:
        losses.extend([] if loss is None else [loss])

    settings = dataclasses.replace(SETTINGS, iterations=12)
    found = lnst(clip, look, settings, tell)
    assert len(losses) == 12
    assert losses[-1] < losses[0]
    assert found.shape == clip.density.shape
    assert found.min() >= 0


def test_smoothing_keeps_what_does_not_change_and_nothing_is_the_result_frame_by_frame() -> None:
    updates = torch.rand(1, 5, 2, generator=torch.Generator().manual_seed(0)).expand(7, 5, 2)
    assert torch.allclose(smoothed(updates, 3.0), updates, atol=1e-6)
    flicker = torch.tensor([1.0, -1.0] * 4)[:, None, None].expand(8, 3, 2)
    assert smoothed(flicker, 3.0).abs().max() < 0.2
    assert torch.equal(smoothed(flicker, 0.0), flicker)


@pytest.mark.parametrize("spreading", [0, 3])
def test_same_seed_same_bits(clip: Clip, look: Look, spreading: int) -> None:
    settings = dataclasses.replace(SETTINGS, spreading=spreading)
    assert torch.equal(lnst(clip, look, settings, quiet), lnst(clip, look, settings, quiet))
