"""Networks that describe pictures, by name."""

import sys

import torch

from vnca.features.efficientnet import NAME as DEFAULT
from vnca.features.efficientnet import EfficientNet
from vnca.features.network import FeatureNetwork
from vnca.features.vgg import VGG16
from vnca.features.weights import is_cached

VGG = "vgg16"
"""ImageNet's VGG16 where it was fetched before, else `edges`: nothing is fetched by itself."""


def load_network(source: str = DEFAULT, device: torch.device | str | None = None) -> FeatureNetwork:
    """A network by `efficientnet`, `edges`, `imagenet`, `vgg16`, or the path of a VGG's weights.

    Args:
        source: Its name, or the file.
        device: CPU if None.

    Raises:
        BackendUnavailableError: If the weights are not installed or cannot be downloaded.
        FileFormatError: If the file does not hold such a network.
        OptionError: If `source` is none of these.
    """
    if source == DEFAULT:
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
