"""Frozen networks that describe pictures: what the losses ask of one, and each by its name."""

import sys
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from vnca.core.errors import OptionError, ShapeError

SMALLEST = 32
"""Rows and columns a picture must have."""


@runtime_checkable
class FeatureNetwork(Protocol):
    """A frozen network whose activations say what a picture looks like.

    A map says of itself how coarse it is: its positions divide the picture evenly.

    Attributes:
        name: Where the weights come from; losses of different ones cannot be compared.
        origin: SHA-256 of the file they were first read from.
        dtype: Of the arithmetic inside; features come in the picture's.
        style_layers: The layers that are compared unless others are asked for.
    """

    name: str
    origin: str
    dtype: torch.dtype
    style_layers: tuple[str, ...]

    @property
    def device(self) -> torch.device:
        """Where it computes."""
        ...

    def features(
        self, image: Float[Tensor, "b 3 r c"], layers: Sequence[str] | None = None
    ) -> list[Float[Tensor, "b _ _ _"]]:
        """Activations of each of `layers`, in that order; of `style_layers` unless given.

        Nothing is computed beyond the deepest. Differentiable in `image`.

        Args:
            image: sRGB in 0–1.
            layers: Names, as the network has them.

        Raises:
            OptionError: If a layer does not exist.
            ShapeError: If the image is smaller than 32×32 or has not three channels.
        """
        ...


def require_fitting(
    network: FeatureNetwork, image: Tensor, layers: Sequence[str], known: Sequence[str]
) -> None:
    """Refuse what `FeatureNetwork.features` cannot take.

    Raises:
        OptionError: If a layer is not among the `known`.
        ShapeError: If the image is smaller than 32×32 or has not three channels.
    """
    for layer in layers:
        if layer not in known:
            raise OptionError(
                f"layer {layer!r}: features '{network.name}' have {', '.join(known)}; see "
                "`appearance.layers`"
            )
    if image.ndim != 4 or image.shape[1] != 3 or min(image.shape[2:]) < SMALLEST:
        raise ShapeError(
            f"picture for features '{network.name}': expected [b, 3, r, c] with at least "
            f"{SMALLEST} rows and columns, got {tuple(image.shape)}"
        )


EFFICIENTNET = "efficientnet"
"""The default."""
VGG = "vgg16"
"""ImageNet's VGG16 where it was fetched before, else `edges`: nothing is fetched by itself."""


def load_network(
    source: str = EFFICIENTNET, device: torch.device | str | None = None
) -> FeatureNetwork:
    """A network by `efficientnet`, `edges`, `imagenet`, `vgg16`, or the path of a VGG's weights.

    Args:
        source: Its name, or the file.
        device: CPU if None.

    Raises:
        BackendUnavailableError: If the weights are not installed or cannot be downloaded.
        FileFormatError: If the file does not hold such a network.
        OptionError: If `source` is none of these.
    """
    from vnca.features.efficientnet import EfficientNet
    from vnca.features.vgg import VGG16
    from vnca.features.weights import is_cached

    if source == EFFICIENTNET:
        return EfficientNet.load(device)
    if source == VGG:
        source = "imagenet" if is_cached("imagenet") else "edges"
        if source == "edges":
            print(
                "features: 'edges' in the place of ImageNet's VGG16, which `--features imagenet` "
                "fetches, once (528 MB)",
                file=sys.stderr,
            )
    return VGG16.load(source, device)
