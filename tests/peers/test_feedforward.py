import dataclasses

import pytest
import torch

from vnca.peers import Clip, Look
from vnca.peers.feedforward import ForwardNetwork, ForwardSettings, aurand_forward, tiled, trained

SETTINGS = ForwardSettings(iterations=4, patch=16, views=1)


def quiet(done: int, total: int, loss: float | None) -> None:
    pass


def busy(settings: ForwardSettings) -> ForwardNetwork:
    """A network whose output is not zero."""
    torch.manual_seed(0)
    network = ForwardNetwork(settings)
    torch.nn.init.normal_(network.last.weight, std=0.5)
    return network.eval()


@pytest.mark.parametrize("changes", ["velocity", "density"])
def test_a_new_network_changes_nothing(clip: Clip, look: Look, changes: str) -> None:
    settings = dataclasses.replace(SETTINGS, iterations=0, changes=changes)
    assert torch.allclose(aurand_forward(clip, look, settings, quiet), clip.density, atol=1e-5)


def test_tiles_are_as_all_of_it_at_once_bit_for_bit() -> None:
    smoke = torch.rand(90, 21, 74, generator=torch.Generator().manual_seed(1))
    network = busy(SETTINGS)
    whole = tiled(network, smoke, 1000)
    assert whole.shape == (90, 21, 74, 3)
    assert whole.std() > 1e-3
    assert torch.equal(tiled(network, smoke, 24), whole)


def test_it_learns(clip: Clip, look: Look) -> None:
    losses: list[float] = []
    settings = dataclasses.replace(SETTINGS, iterations=50, rate=2e-3, enlarged=1.0)
    # In smoke that is the same all over, it has nothing to tell one place from another by.
    uneven = torch.rand(clip.density.shape, generator=torch.Generator().manual_seed(0))
    clip = dataclasses.replace(clip, density=clip.density * uneven)
    trained(clip, look, settings, lambda done, loss: losses.append(loss))
    assert sum(losses[-8:]) < 0.95 * sum(losses[:8])


def test_same_seed_same_bits_whatever_was_drawn_before(clip: Clip, look: Look) -> None:
    first = aurand_forward(clip, look, SETTINGS, quiet)
    torch.rand(1)
    assert torch.equal(aurand_forward(clip, look, SETTINGS, quiet), first)
    other = dataclasses.replace(SETTINGS, seed=1)
    assert not torch.equal(aurand_forward(clip, look, other, quiet), first)
