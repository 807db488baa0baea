"""The differentiable twins of `vnca.core.colour`."""

import torch
from jaxtyping import Float
from torch import Tensor

from vnca.core.colour import LUMINANCE_WEIGHTS


def srgb_to_linear(value: Float[Tensor, "*shape"]) -> Float[Tensor, "*shape"]:
    """Decode sRGB to linear light; see `vnca.core.colour.srgb_to_linear`.

    Differentiable, with a finite gradient everywhere: the power never sees a value at which
    its slope is infinite or undefined, even where it is not the piece selected.
    """
    power = ((value.clamp_min(0.04045) + 0.055) / 1.055) ** 2.4
    return torch.where(value <= 0.04045, value / 12.92, power)


def linear_to_srgb(value: Float[Tensor, "*shape"]) -> Float[Tensor, "*shape"]:
    """Encode linear light as sRGB; see `vnca.core.colour.linear_to_srgb`.

    Differentiable, with a finite gradient everywhere.
    """
    power = 1.055 * value.clamp_min(0.0031308) ** (1 / 2.4) - 0.055
    return torch.where(value <= 0.0031308, value * 12.92, power)


def luminance(rgb: Float[Tensor, "*shape 3"]) -> Float[Tensor, "*shape"]:
    """Rec. 709 relative luminance of linear RGB. Differentiable."""
    return rgb @ rgb.new_tensor(LUMINANCE_WEIGHTS)
