import numpy as np
import pytest

from vnca.core import FloatArray
from vnca.features.vgg import VGG16
from vnca.losses.appearance import AppearanceLoss
from vnca.metrics.style_score import slice_distances
from vnca.training.config import TextureConfig


@pytest.fixture(scope="module")
def appearance(vgg: VGG16, style: FloatArray, tiny_config: TextureConfig) -> AppearanceLoss:
    return AppearanceLoss(vgg, style, tiny_config.appearance, 32)


def test_a_block_of_the_picture_is_nearer_than_a_grey_one(
    appearance: AppearanceLoss, style: FloatArray
) -> None:
    checks = np.add.outer(np.add.outer(*[np.arange(32) // 8] * 2), np.arange(32) // 8) % 2
    painted = style[[0, 0], [0, 8]][checks]
    grey = np.full_like(painted, 0.2)
    near, far = (slice_distances(b, appearance, size=32, count=3) for b in (painted, grey))
    assert set(near) == {"axis", "oblique", "unseen"}
    for family in near:
        assert near[family].total < 0.7 * far[family].total
        assert near[family].total == pytest.approx(sum(near[family].terms.values()), rel=1e-5)


def test_the_same_slices_are_asked_every_time(appearance: AppearanceLoss) -> None:
    block = np.random.default_rng(0).random((16, 16, 16, 3)).astype(np.float32)
    one, two = (slice_distances(block, appearance, size=32, count=2) for _ in range(2))
    assert one == two
    assert slice_distances(block, appearance, size=32, count=2, seed=1) != one
