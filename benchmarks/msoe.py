"""The published two-stream dynamics network, for comparison only; its weights are not ours.

Its parts are those of its authors: pictures of unit contrast over the pair, five scales (5×5
Gaussian of σ 2, every second pixel), 11×11 filters over the pair, squares, 5×5 maximum, a 1×1
layer over its sum of magnitudes, all scales brought to the finest, 3×3, ReLU, 1×1; borders are
mirrored. It gives pixels to the right and up. Its grid of halvings wants multiples of 16.

Reference: Tesfaldet, Brubaker and Derpanis 2018.
"""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from vnca.core import FloatArray
from vnca.core.errors import FileFormatError
from vnca.core.files import existing_file
from vnca.metrics.motion import Estimator

SCALES = 5


def published(path: Path) -> Estimator:
    """An estimator with the weights of an `.npz` file.

    Raises:
        FileFormatError: If the file is missing or holds something else.
    """
    network = _TwoStreamDynamics()
    try:
        with np.load(existing_file(path), allow_pickle=False) as file:
            state = {
                key.removeprefix("msoenet."): torch.from_numpy(file[key]) for key in file.files
            }
        network.load_state_dict(state)
    except (ValueError, OSError, RuntimeError) as error:
        raise FileFormatError(f"{path}: not the weights of the published network") from error
    network.requires_grad_(False).eval()

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        pair = torch.from_numpy(np.stack([before, after])[None]).float()
        return np.ascontiguousarray(network(pair)[0].permute(1, 2, 0).numpy())

    return estimate


class _TwoStreamDynamics(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv3d(1, 32, (11, 11, 2))
        self.conv2 = nn.Conv2d(32, 64, 1)
        self.decode_conv1 = nn.Conv2d(64 * SCALES, 64, 3)
        self.decode_conv2 = nn.Conv2d(64, 2, 1)

    def forward(self, pair: Tensor) -> Tensor:
        """`[b, 2, r, c]` to pixels right and down."""
        assert pair.shape[2] % 16 == 0
        assert pair.shape[3] % 16 == 0
        pair = pair - pair.mean(dim=(1, 2, 3), keepdim=True)
        pair = pair / (pair.var(dim=(1, 2, 3), keepdim=True) + 1e-12).sqrt()
        taps = torch.exp(-(torch.arange(-2.0, 3.0) ** 2) / (2 * 2.0**2))
        blur = torch.outer(taps, taps)
        blur = (blur / blur.sum()).expand(2, 1, 5, 5)
        maps: list[Tensor] = []
        for scale in range(SCALES):
            if scale:
                pair = functional.conv2d(_mirrored(pair, 2), blur, stride=2, groups=2)
            seen = self.conv1(_mirrored(pair, 5).permute(0, 2, 3, 1)[:, None])[..., 0]
            seen = self.conv2(functional.max_pool2d(seen.square(), 5, stride=1, padding=2))
            seen = seen / seen.abs().sum(dim=1, keepdim=True).clamp(min=1e-12)
            maps.append(_enlarged(seen, 2**scale))
        flow = self.decode_conv2(
            functional.relu(self.decode_conv1(_mirrored(torch.cat(maps, dim=1), 1)))
        )
        return flow * flow.new_tensor([1.0, -1.0]).view(2, 1, 1)


def _mirrored(picture: Tensor, margin: int) -> Tensor:
    """With a border in which the outermost pixels come twice."""
    for axis in (2, 3):
        length = picture.shape[axis]
        period = torch.arange(-margin, length + margin) % (2 * length)
        picture = picture.index_select(axis, torch.minimum(period, 2 * length - 1 - period))
    return picture


def _enlarged(maps: Tensor, factor: int) -> Tensor:
    """Coarse pixel i on fine pixel i · factor, which is where its blur was centred."""
    for axis in (2, 3):
        length = maps.shape[axis]
        at = (torch.arange(length * factor) / factor).clamp(max=length - 1)
        low = at.long()
        high = (low + 1).clamp(max=length - 1)
        share = (at - low).view([-1 if i == axis else 1 for i in range(4)])
        maps = torch.lerp(maps.index_select(axis, low), maps.index_select(axis, high), share)
    return maps
