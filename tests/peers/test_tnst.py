import dataclasses

import pytest
import torch

from vnca.peers import Clip, Look
from vnca.peers.tnst import TnstSettings, averaged, moved, tnst

SETTINGS = TnstSettings(iterations=3, octaves=1, views=2, rate=0.02, enlarged=2.0)


def quiet(done: int, total: int, loss: float | None) -> None:
    pass


@pytest.mark.parametrize("potential", ["scalar", "vector"])
def test_a_potential_of_zero_is_the_identity(clip: Clip, potential: str) -> None:
    vector = [3] if potential == "vector" else []
    settings = dataclasses.replace(SETTINGS, potential=potential)
    still = moved(clip.density[0], torch.zeros(*clip.shape, *vector), settings)
    assert torch.allclose(still, clip.density[0], atol=1e-5)


def test_a_ramp_moves_smoke_by_its_slope_in_half_heights(clip: Clip) -> None:
    height = clip.shape[2]
    ramp = torch.arange(clip.shape[0]).float()[:, None, None].expand(clip.shape) * 2 / height
    there = moved(clip.density[0], ramp, SETTINGS)
    assert torch.allclose(there[1:], clip.density[0][:-1], atol=1e-4)


@pytest.mark.parametrize("potential", ["scalar", "vector"])
@pytest.mark.parametrize("as_published", [False, True])
def test_it_comes_nearer_to_the_picture(
    clip: Clip, look: Look, potential: str, as_published: bool
) -> None:
    losses: list[float] = []
    settings = dataclasses.replace(
        SETTINGS, iterations=6, potential=potential, as_published=as_published
    )
    found = tnst(clip, look, settings, lambda done, total, loss: losses.append(loss or 0.0))
    assert losses[-1] < losses[0]
    assert found.shape == clip.density.shape
    assert found.min() >= 0
    assert not torch.allclose(found, clip.density, atol=0.05)


def test_slips_of_the_published_code_change_the_result(clip: Clip, look: Look) -> None:
    published = dataclasses.replace(SETTINGS, as_published=True)
    difference = tnst(clip, look, SETTINGS, quiet) - tnst(clip, look, published, quiet)
    assert difference.abs().max() > 0.02


def test_averaging_follows_the_flow(clip: Clip) -> None:
    steps = list(clip.density)  # which rise with the smoke
    followed = averaged(steps, clip.velocity, SETTINGS)
    for step, found in zip(steps, followed, strict=True):
        assert torch.allclose(found[..., 4:-4], step[..., 4:-4], atol=1e-3)
    at_rest = averaged(steps, torch.zeros_like(clip.velocity), SETTINGS)
    assert (at_rest[0] - steps[0]).abs().max() > 0.2


def test_published_averages_are_of_averages() -> None:
    steps = [torch.full((4, 4, 4), float(t)) for t in range(3)]
    still = torch.zeros(3, 4, 4, 4, 3)
    narrow = dataclasses.replace(SETTINGS, window=3)
    mended = [float(s.mean()) for s in averaged(steps, still, narrow)]
    assert mended == pytest.approx([0.5, 1.0, 1.5])
    published = dataclasses.replace(narrow, as_published=True)
    in_place = [float(s.mean()) for s in averaged(steps, still, published)]
    assert in_place == pytest.approx([0.5, (0.5 + 1 + 2) / 3, ((0.5 + 1 + 2) / 3 + 2) / 2])


def test_a_window_of_one_is_the_result_frame_by_frame(clip: Clip, look: Look) -> None:
    settings = dataclasses.replace(SETTINGS, window=1, views=1)
    together = tnst(clip, look, settings, quiet)
    alone = Clip(clip.density[:1], clip.velocity[:1])
    brightest = tnst(alone, look, settings, quiet)[0]
    assert torch.allclose(together[0], brightest, atol=0.05)


def test_same_seed_same_bits(clip: Clip, look: Look) -> None:
    assert torch.equal(tnst(clip, look, SETTINGS, quiet), tnst(clip, look, SETTINGS, quiet))
