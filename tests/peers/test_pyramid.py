import pytest
import torch

from vnca.peers.pyramid import (
    GAIN,
    PUBLISHED_GAIN,
    bands,
    merged,
    normalised,
    normalised_flow,
    unit,
)

SHAPES = [(16, 16, 16), (13, 18, 11)]


def noise(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("gain", [GAIN, PUBLISHED_GAIN])
def test_bands_add_up_to_the_field(shape: tuple[int, int, int], gain: float) -> None:
    field = noise(*shape)
    assert torch.allclose(merged(bands(field, 3, gain), gain), field, atol=1e-5)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_band_has_unit_root_mean_square(shape: tuple[int, int, int]) -> None:
    for band in bands(noise(*shape) * 37, 3):
        assert unit(band).square().mean().sqrt() == pytest.approx(1.0, abs=1e-5)
    # So the strength of a gradient does not matter.
    assert torch.allclose(
        normalised(noise(*shape), 3), normalised(1e-6 * noise(*shape), 3), atol=1e-3
    )


def test_the_mended_way_up_keeps_a_constant_and_the_published_does_not() -> None:
    flat = torch.ones(32, 32, 32)
    inside = (slice(8, -8),) * 3
    mended, published = (bands(flat, 1, gain)[0][inside] for gain in (GAIN, PUBLISHED_GAIN))
    assert mended.abs().max() < 1e-5
    assert published.abs().min() > 0.3


def test_bands_of_a_flow_keep_their_direction() -> None:
    flow = noise(12, 12, 12)[..., None] * torch.tensor([3.0, 0.0, -4.0])
    even = normalised_flow(flow, 2)
    assert torch.allclose(even[..., 0] * -4, even[..., 2] * 3, atol=1e-4)
    assert even[..., 1].abs().max() == 0


def test_a_field_of_nothing_stays_so() -> None:
    assert normalised(torch.zeros(9, 9, 9), 3).abs().max() == 0
