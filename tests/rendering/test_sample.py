import numpy as np
import pytest
import torch

from vnca.rendering.march import _by_corners, sample


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("shape", [(4, 5, 6), (1, 3, 2)])
def test_sampling_agrees_with_interpolation_written_out(dtype, shape) -> None:
    rng = np.random.default_rng(0)
    field = rng.random((*shape, 2))
    points = rng.uniform(-2, np.array(shape) + 1, (200, 3))
    padded = np.pad(field, [(3, 3)] * 3 + [(0, 0)])
    base = np.floor(points).astype(int)
    t = points - base
    expected = np.zeros((200, 2))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, t, 1 - t), axis=1)
        x, y, z = (base + corner + 3).T
        expected += weight[:, None] * padded[x, y, z]
    found = sample(torch.from_numpy(field).to(dtype), torch.from_numpy(points).to(dtype))
    assert found.dtype == dtype
    tolerance = 1e-5 if dtype == torch.float32 else 1e-12
    np.testing.assert_allclose(found.numpy(), expected, atol=tolerance)


def test_sampling_gradient_matches_finite_differences() -> None:
    generator = torch.Generator().manual_seed(0)
    field = torch.rand(2, 3, 2, 2, dtype=torch.float64, generator=generator, requires_grad=True)
    points = torch.rand(9, 3, dtype=torch.float64, generator=generator) * 4 - 1
    assert torch.autograd.gradcheck(lambda f: sample(f, points), (field,))


def test_on_a_gpu_sampling_is_the_same_but_for_rounding() -> None:
    generator = torch.Generator().manual_seed(1)
    field = torch.rand(4, 5, 3, 2, dtype=torch.float64, generator=generator, requires_grad=True)
    points = torch.rand(300, 3, dtype=torch.float64, generator=generator) * 8 - 2
    weights = torch.rand(300, 2, dtype=torch.float64, generator=generator)
    expected, found = sample(field, points), _by_corners(field, points)
    torch.testing.assert_close(found, expected)
    gradients = [torch.autograd.grad((v * weights).sum(), field)[0] for v in (expected, found)]
    torch.testing.assert_close(gradients[1], gradients[0])
