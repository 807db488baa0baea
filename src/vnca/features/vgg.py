"""The frozen VGG16 or VGG19 whose activations say what a picture looks like.

Reference: Simonyan and Zisserman 2015, configurations D and E.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from vnca.features import require_fitting
from vnca.features.weights import Weights, convolutions, load_weights

STYLE_LAYERS = ("relu1_1", "relu2_1", "relu3_1", "relu4_1", "relu5_1")
"""The five layers texture automata compare (Niklasson et al. 2021)."""


class VGG16(nn.Module):
    """VGG16's convolutions with frozen weights; with more of them where the weights are VGG19's.

    Attributes:
        name: Where the weights come from; losses of different ones cannot be compared.
        origin: SHA-256 of the file they were first read from.
        dtype: Of the arithmetic inside; features come in the picture's.
        style_layers: The layers that are compared unless others are asked for.
    """

    mean: Tensor
    style_layers: tuple[str, ...] = STYLE_LAYERS

    def __init__(self, weights: Weights, dtype: torch.dtype = torch.float32) -> None:
        super().__init__()
        self.dtype = dtype
        self.name = weights.name
        self.origin = weights.origin
        self.register_buffer("mean", torch.tensor(weights.mean).view(1, 3, 1, 1))
        self.convolutions = nn.ModuleDict()
        for conv, (inputs, outputs) in convolutions(weights.depth).items():
            if f"{conv}.weight" not in weights.tensors:
                break
            layer = nn.Conv2d(inputs, outputs, 3, padding=1)
            layer.load_state_dict(
                {kind: weights.tensors[f"{conv}.{kind}"] for kind in ("weight", "bias")}
            )
            self.convolutions[conv] = layer
        self.requires_grad_(False).eval()
        # Feature vectors are rows of the maps, so a map's channels should lie side by side.
        self.convolutions.to(dtype=dtype, memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    @classmethod
    def load(
        cls,
        source: str = "edges",
        device: torch.device | str | None = None,
        dtype: torch.dtype | None = None,
    ) -> "VGG16":
        """The network with weights from `edges`, `imagenet` or the path of a file.

        Args:
            source: Where the weights come from.
            device: CPU if None.
            dtype: Of the arithmetic; if None, bfloat16 on processors that compute in it, which
                takes half the time for features within half a percent, else float32.

        Raises:
            BackendUnavailableError: If the weights are not installed or cannot be downloaded.
            FileFormatError: If the file does not hold a VGG16.
            OptionError: If `source` is none of these.
        """
        device = torch.device(device or "cpu")
        return cls(load_weights(source), dtype or _fast_dtype(device)).to(device)

    @property
    def device(self) -> torch.device:
        """Where it computes."""
        return self.mean.device

    def features(
        self, image: Float[Tensor, "b 3 r c"], layers: Sequence[str] | None = None
    ) -> list[Float[Tensor, "b _ _ _"]]:
        """Activations after the ReLU of each of `layers`, as `FeatureNetwork.features` has it.

        Block `B` has 2^(B−1) times fewer rows and columns than the image, rounded up.

        Args:
            image: sRGB in 0–1.
            layers: Names `reluB_I`, block and convolution counted from 1.

        Raises:
            OptionError: If a layer does not exist.
            ShapeError: If the image is smaller than 32×32 or has not three channels.
        """
        layers = self.style_layers if layers is None else layers
        known = [conv.replace("conv", "relu") for conv in self.convolutions]
        require_fitting(self, image, layers, known)
        wanted = [layer.replace("relu", "conv") for layer in layers]
        x = (image - self.mean).to(self.dtype, memory_format=torch.channels_last)
        found: dict[str, Tensor] = {}
        for conv, layer in self.convolutions.items():
            if conv.endswith("_1") and conv != "conv1_1":
                x = functional.max_pool2d(x, 2, ceil_mode=True)
            x = functional.relu(layer(x))
            if conv in wanted:
                found[conv] = x
            if len(found) == len(set(wanted)):
                break
        return [found[conv].to(image.dtype) for conv in wanted]


def _fast_dtype(device: torch.device) -> torch.dtype:
    if device.type == "cuda":
        native = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        # Absent from older versions of torch, which then compute in float32.
        abilities = getattr(torch.cpu, "get_capabilities", dict)()
        native = any(abilities.get(name) for name in ("avx512_bf16", "amx_bf16"))
    return torch.bfloat16 if native and device.type in ("cpu", "cuda") else torch.float32
