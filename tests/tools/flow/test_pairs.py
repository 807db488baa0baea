import pytest
import torch
from displacement import random_displacement, sampled
from pairs import moving_texture, random_pairs, random_silhouette
from textures import bank, spectral, waves
from torch import Generator, Tensor


@pytest.fixture(scope="module")
def textures() -> Tensor:
    return bank({spectral: 1, waves: 2}, 12, 128, Generator().manual_seed(0))


def moving(textures: Tensor, replaced: float) -> tuple[Tensor, Tensor, Tensor]:
    random = Generator().manual_seed(1)
    flow = random_displacement(torch.full((16, 1, 1), 2.0), 64, random)
    share = torch.full((16, 1, 1), replaced)
    return flow, *moving_texture(textures, flow, share, random)


def test_the_texture_moves_as_the_field_says(textures: Tensor) -> None:
    flow, before, after = moving(textures, 0.0)
    inner = (slice(None), slice(8, -8), slice(8, -8))
    still = (after - before)[inner].square().mean()
    followed = (sampled(after[:, None], flow)[:, 0] - before)[inner].square().mean()
    assert followed < 0.1 * still


def test_the_share_asked_for_is_replaced(textures: Tensor) -> None:
    _, _, kept = moving(textures, 0.0)
    _, _, partly = moving(textures, 0.3)
    _, _, other = moving(textures, 1.0)
    torch.testing.assert_close(partly, 0.7**0.5 * kept + 0.3**0.5 * other)


def test_pairs_to_train_on_are_pictures_of_all_kinds(textures: Tensor) -> None:
    pairs = random_pairs(textures, 48, 64, Generator().manual_seed(2))
    for picture in (pairs.before, pairs.after):
        assert picture.shape == (48, 64, 64)
        assert picture.min() >= 0
        assert picture.max() <= 1
    whole = pairs.seen.flatten(1).min(dim=1).values > 0.99
    assert 0 < whole.sum() < 48
    still = pairs.flow.flatten(1).abs().max(dim=1).values == 0
    assert 0 < still.sum() < 16


def test_easy_pairs_fill_the_picture(textures: Tensor) -> None:
    assert (random_pairs(textures, 8, 64, Generator().manual_seed(2), easy=1.0).seen == 1).all()


def test_silhouettes_leave_some_background() -> None:
    silhouette = random_silhouette(32, 64, Generator().manual_seed(0))
    assert silhouette.min() >= 0
    assert silhouette.max() <= 1
    share = (silhouette > 0.5).float().mean()
    assert 0.2 < share < 0.9
