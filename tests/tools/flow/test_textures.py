import pytest
import torch
from textures import KINDS, PHOTOGRAPHS, bank, cut, photographs, spectral
from torch import Generator


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_kind_is_a_texture_and_the_seed_decides_which(kind) -> None:
    first, again, other = (bank({kind: 1}, 3, 48, Generator().manual_seed(s)) for s in (0, 0, 1))
    assert first.shape == (3, 48, 48)
    torch.testing.assert_close(first.mean(dim=(1, 2)), torch.zeros(3), atol=1e-4, rtol=0)
    torch.testing.assert_close(first.std(dim=(1, 2)), torch.ones(3), atol=1e-3, rtol=0)
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
    assert not torch.equal(first[0], first[1])


def test_the_bank_keeps_proportions() -> None:
    textures = bank({spectral: 3, photographs: 1}, 40, 32, Generator().manual_seed(0))
    assert len(textures) == 40


def test_photographs_are_those_of_known_licence() -> None:
    assert len(PHOTOGRAPHS) == 10
    assert photographs(10, 32, Generator().manual_seed(0)).isfinite().all()


def test_a_picture_smaller_than_the_cut_is_enlarged() -> None:
    assert cut(torch.rand(20, 30), 48, Generator().manual_seed(0)).shape == (48, 48)
