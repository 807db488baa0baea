from itertools import islice

import numpy as np
import pytest
import torch
from gutierrez import SCALES, Generator, noise, on_demand, trained
from kopf import Exemplar, exemplars, histogram, improved, kopf_blocks

from vnca.core import FloatArray
from vnca.features.vgg import VGG16
from vnca.painting.block import border_jump


@pytest.fixture(scope="module")
def style() -> FloatArray:
    """Blue and ochre stripes that lie level, linear RGB."""
    at = (np.mgrid[:32, :32][0] // 4) % 2
    return np.array([[0.02, 0.05, 0.3], [0.6, 0.3, 0.05]], np.float32)[at]


def test_the_nearest_neighbourhood_is_the_nearest(style: FloatArray) -> None:
    exemplar = Exemplar(torch.rand(3, 20, 20, generator=torch.Generator().manual_seed(0)))
    chosen = torch.tensor([3, 100, 77])
    assert exemplar.nearest(exemplar.patches[chosen]).tolist() == chosen.tolist()


def test_a_block_that_shows_the_picture_keeps_showing_it(style: FloatArray) -> None:
    picture = exemplars(style, 32)[-1]
    stripes = picture[:, :, 0].flip(1)[:, :16]
    block = stripes[:, None, None].expand(3, 16, 16, 16).contiguous()
    after = improved(block, Exemplar(picture))
    both = torch.stack([block[2].flatten(), after[2].flatten()])
    assert torch.corrcoef(both)[0, 1] > 0.7


def test_blocks_have_the_colours_of_the_picture(style: FloatArray) -> None:
    *_, block = islice(kopf_blocks(style, 32, cells=32), 3)
    assert block.shape == (32, 32, 32, 3)
    ours, theirs = (histogram(torch.from_numpy(b.reshape(-1, 3).T)) for b in (block, style))
    other = histogram(torch.full((3, 8), 0.5))
    assert (ours - theirs).abs().sum() < (other - theirs).abs().sum()
    again = [*islice(kopf_blocks(style, 32, cells=32), 3)][-1]
    np.testing.assert_array_equal(block, again)


def test_a_block_has_no_border(style: FloatArray) -> None:
    random = torch.Generator().manual_seed(0)
    block, exemplar = torch.rand(3, 16, 16, 16, generator=random), Exemplar(exemplars(style, 32)[2])
    moved = improved(block.roll((2, 4, 6), (1, 2, 3)), exemplar)
    torch.testing.assert_close(moved, improved(block, exemplar).roll((2, 4, 6), (1, 2, 3)))


def test_noise_depends_on_place_and_seed_alone() -> None:
    lower = np.array([-3, 5, 0], np.int32)
    whole = noise((lower, lower + 8), 1, seed=4)
    part = noise((lower + 2, lower + 5), 1, seed=4)
    assert torch.equal(whole[:, :, 2:5, 2:5, 2:5], part)
    assert not torch.equal(whole, noise((lower, lower + 8), 1, seed=5))
    assert not torch.equal(whole, noise((lower, lower + 8), 2, seed=4))
    tiled = noise((lower, lower + 8), 1, seed=4, period=8)
    assert torch.equal(tiled[:, :, :4], tiled[:, :, 4:])


def test_a_part_made_alone_is_the_part_of_the_whole() -> None:
    generator = Generator().eval()
    assert 50_000 < sum(weights.numel() for weights in generator.parameters()) < 100_000
    lower = np.array([-7, 2, 33], np.int32)
    with torch.no_grad():
        whole = generator((lower, lower + 9), seed=1)
        part = generator((lower + 3, lower + 7), seed=1)
    torch.testing.assert_close(whole[:, :, 3:7, 3:7, 3:7], part, atol=1e-5, rtol=0)


def test_a_generator_learns_and_its_block_tiles(style: FloatArray) -> None:
    network = VGG16.load("edges")
    learning = trained(style, network, cells=64, slice_size=32)
    first = next(learning).state_dict()["colour.weight"].clone()
    generator = next(learning)
    assert (generator.state_dict()["colour.weight"] != first).any()
    size = 1 << (SCALES - 1)
    block = on_demand(generator, size)
    assert block.shape == (size, size, size, 3)
    assert 0.3 < border_jump(block) < 3
