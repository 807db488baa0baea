import dataclasses
from typing import Any

import pytest
import torch

from vnca.core.errors import OptionError
from vnca.peers import Clip, Look
from vnca.peers.aurand import AurandSettings, aurand, averaged, changed, equalised

SETTINGS = AurandSettings(iterations=3, octaves=1, rate=0.2, enlarged=2.0)


def quiet(done: int, total: int, loss: float | None) -> None:
    pass


def test_no_change_is_the_identity(clip: Clip) -> None:
    density = clip.density[0]
    assert torch.allclose(
        changed(density, torch.zeros(*clip.shape, 3), SETTINGS), density, atol=1e-5
    )
    factors = dataclasses.replace(SETTINGS, changes="density")
    assert torch.equal(changed(density, torch.zeros(clip.shape), factors), density)


@pytest.mark.parametrize("changes", ["velocity", "density"])
def test_it_comes_nearer_to_the_picture(clip: Clip, look: Look, changes: str) -> None:
    losses: list[float] = []
    # Factors can only darken or brighten what is there.
    rate, share = {"velocity": (0.2, 0.9), "density": (0.05, 0.95)}[changes]
    settings = dataclasses.replace(SETTINGS, iterations=8, changes=changes, rate=rate)
    found = aurand(clip, look, settings, lambda done, total, loss: losses.append(loss or 0.0))
    assert losses[-1] < share * losses[0]
    assert found.shape == clip.density.shape
    assert found.min() >= 0
    assert len(losses) == 8


def test_without_averaging_it_is_the_result_frame_by_frame(clip: Clip, look: Look) -> None:
    settings = dataclasses.replace(SETTINGS, alpha=0.0)
    together = aurand(clip, look, settings, quiet)
    for t in range(len(clip.density)):
        alone = Clip(clip.density[t : t + 1], clip.velocity[t : t + 1])
        assert torch.equal(aurand(alone, look, settings, quiet)[0], together[t])
    averaging = aurand(clip, look, SETTINGS, quiet)
    assert not torch.allclose(averaging, together, atol=1e-3)


def test_a_constant_change_in_smoke_at_rest_is_a_fixed_point(clip: Clip) -> None:
    change = torch.tensor([0.3, -0.2, 0.9]).expand(4, *clip.shape, 3)
    at_rest = Clip(clip.density, torch.zeros_like(clip.velocity))
    for backward in (False, True):
        assert torch.allclose(averaged(change, at_rest, 0.4, backward), change, atol=1e-5)


@pytest.mark.parametrize("backward", [False, True])
def test_a_change_that_moves_with_the_smoke_is_a_fixed_point(clip: Clip, backward: bool) -> None:
    # The ball rises by a cell a frame: its own density, told of twice, does, too.
    found = averaged(clip.density, clip, 0.5, backward)
    assert torch.allclose(found[:, :, :, 2:-2], clip.density[:, :, :, 2:-2], atol=1e-4)


def test_displacements_are_capped(clip: Clip, look: Look) -> None:
    settings = dataclasses.replace(SETTINGS, rate=5.0, cap=0.0, iterations=2)
    assert torch.allclose(aurand(clip, look, settings, quiet), clip.density, atol=1e-5)


def test_equalising_spreads_brightness_and_passes_gradients() -> None:
    dark = torch.rand(1, 1, 20, 20, generator=torch.Generator().manual_seed(0)).double() ** 4 * 0.1
    dark[..., :3] = 0
    dark.requires_grad_()
    equal = equalised(dark)
    assert torch.equal(equal[..., :3], dark[..., :3])
    shown = dark[dark > 0]
    ranks = shown.argsort().argsort() / (len(shown) - 1)
    assert (equal[dark > 0] / shown - ranks).abs().max() < 0.02
    (slope,) = torch.autograd.grad(equal.sum(), dark)
    assert (slope[dark > 0] >= 0).all()
    assert slope.max() > 0


def test_same_seed_same_bits(clip: Clip, look: Look) -> None:
    assert torch.equal(aurand(clip, look, SETTINGS, quiet), aurand(clip, look, SETTINGS, quiet))


@pytest.mark.parametrize(
    "wrong", [{"alpha": 1.0}, {"octaves": 0}, {"rate": -1.0}, {"cap": -1.0}, {"gamma": 0.0}]
)
def test_numbers_out_of_range_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(OptionError, match=f"`{next(iter(wrong))}`"):
        AurandSettings(**wrong)
