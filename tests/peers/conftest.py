"""What tests of other methods share: a rising ball, and a network that needs no weights."""

from collections.abc import Sequence

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from vnca.peers import Clip, Look
from vnca.peers.transport import places

SHAPE = (16, 16, 20)


class Filters:
    """A network of filters drawn at random: it tells textures apart, as trained ones do."""

    name = "filters"
    origin = ""
    dtype = torch.float32
    style_layers: tuple[str, ...] = ("fine", "coarse")
    device = torch.device("cpu")

    def __init__(self) -> None:
        self._weights = torch.randn(8, 3, 3, 3, generator=torch.Generator().manual_seed(0))

    def features(self, image: Tensor, layers: Sequence[str] | None = None) -> list[Tensor]:
        """Rectified responses at full and half size."""
        sizes = {"fine": image, "coarse": functional.avg_pool2d(image, 2)}
        return [
            functional.relu(functional.conv2d(sizes[layer], self._weights, padding=1))
            for layer in layers or self.style_layers
        ]


@pytest.fixture
def clip() -> Clip:
    """A ball that rises by a cell a frame, for four frames."""
    at = places(SHAPE, torch.zeros(1))
    frames = [
        (4.5 - (at - torch.tensor([7.5, 7.5, 7.0 + t])).norm(dim=-1)).clamp(0, 1) for t in range(4)
    ]
    velocity = torch.tensor([0.0, 0.0, 1.0]).expand(4, *SHAPE, 3).contiguous()
    return Clip(torch.stack(frames), velocity)


@pytest.fixture
def look() -> Look:
    """Stripes."""
    rows = np.arange(64, dtype=np.float32)[:, None]
    stripes = 0.5 + 0.5 * np.sin(rows * 0.9) * np.ones((64, 64), np.float32)
    return Look(stripes.astype(np.float32), Filters())
