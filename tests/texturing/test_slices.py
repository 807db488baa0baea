import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.core.camera import view_axes
from vnca.painting.block import sample_block
from vnca.training.scenes.texture import (
    DIAGONAL,
    FAMILIES,
    UNSEEN,
    as_picture,
    is_unseen,
    shown,
    slice_points,
)


@pytest.fixture(scope="module")
def block() -> FloatArray:
    return np.random.default_rng(0).random((8, 8, 8, 3)).astype(np.float32)


def normals(family: str, count: int = 400) -> np.ndarray:
    random = np.random.default_rng(3)
    return np.array([view_axes(*FAMILIES[family](random))[2] for _ in range(count)])


def test_axis_slices_lie_along_the_axes_and_all_of_them() -> None:
    found = np.abs(normals("axis"))
    np.testing.assert_allclose(np.sort(found, 1)[:, 2], 1)
    assert (found.argmax(1)[:, None] == [0, 1, 2]).any(0).all()


def test_oblique_slices_are_everywhere_but_where_the_unseen_are() -> None:
    oblique, unseen = normals("oblique"), normals("unseen")
    assert np.abs(oblique.mean(0)).max() < 0.15
    angle = np.degrees(np.arccos(np.abs(oblique @ np.array([1, 1, 1]) / 3**0.5).clip(0, 1)))
    assert angle.min() > UNSEEN
    diagonals = np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / 3**0.5
    nearest = np.abs(unseen @ diagonals.T).max(1)
    assert np.degrees(np.arccos(nearest)).max() < UNSEEN
    assert is_unseen(45, DIAGONAL)
    assert not is_unseen(45, 0)


def test_a_slice_along_the_axes_shows_the_cells_upright(block: FloatArray) -> None:
    # From the front: +x to the right, +z up, in the plane y = 5.
    points = slice_points((0, 0), np.array([3.5, 5, 3.5]), size=8)
    picture = shown(torch.from_numpy(block), points).numpy()
    np.testing.assert_allclose(picture, block[:, 5, ::-1].transpose(1, 0, 2), atol=1e-5)


def test_slices_wrap_around_and_agree_with_the_sampling_of_baking(block: FloatArray) -> None:
    random = np.random.default_rng(1)
    for family in FAMILIES.values():
        points = slice_points(family(random), random.uniform(0, 8, 3), size=20, spacing=1.3)
        picture = shown(torch.from_numpy(block), points)
        expected = sample_block(block, points.reshape(-1, 3).numpy()).reshape(20, 20, 3)
        np.testing.assert_allclose(picture.numpy(), expected, atol=1e-4)


def test_every_cell_that_is_shown_has_a_gradient(block: FloatArray) -> None:
    values = torch.from_numpy(block).requires_grad_()
    points = slice_points((0, 0), np.array([3.5, 5, 3.5]), size=8)
    shown(values, points).sum().backward()
    assert values.grad is not None
    np.testing.assert_allclose(values.grad[:, 5].numpy(), 1, atol=1e-5)
    assert values.grad[:, :4].abs().max() < 1e-5


def test_pictures_are_srgb_with_channels_first() -> None:
    picture = as_picture(torch.full((4, 6, 3), 0.214))
    assert picture.shape == (1, 3, 4, 6)
    assert picture[0, 0, 0, 0] == pytest.approx(0.5, abs=1e-3)
