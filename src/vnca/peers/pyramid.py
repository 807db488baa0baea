"""Gradients made equally strong in every octave of frequency, by a Laplacian pyramid.

Reference: Kim et al. 2019, after Mordvintsev et al. 2015: gradients of a network are mostly of
high frequency, and a step along them changes little that is large.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

_BINOMIAL = (1.0, 4.0, 6.0, 4.0, 1.0)
_LEAST = 1e-12
GAIN, PUBLISHED_GAIN = 8.0, 5.0
"""Of the way up, on which an eighth of the cells hold a value: 8 keeps a constant. The published
code of TNST has 5 there, so a part of each octave stays in the finer one."""


def bands(
    field: Float[Tensor, "x y z"], levels: int, gain: float = GAIN
) -> list[Float[Tensor, "_ _ _"]]:
    """What a field has in each octave, the finest first, and last what is coarser than all."""
    found = []
    for _ in range(levels):
        if min(field.shape) < 2:
            break
        coarse = _down(field)
        found.append(field - _up(coarse, field.shape, gain))
        field = coarse
    return [*found, field]


def merged(parts: list[Float[Tensor, "_ _ _"]], gain: float = GAIN) -> Float[Tensor, "x y z"]:
    """The field that has these bands."""
    *finer, field = parts
    for band in reversed(finer):
        field = band + _up(field, band.shape, gain)
    return field


def normalised(field: Float[Tensor, "x y z"], levels: int, gain: float = GAIN) -> Tensor:
    """The field with every band divided by its root mean square; a silent one stays silent."""
    return merged([unit(band) for band in bands(field, levels, gain)], gain)


def unit(band: Tensor) -> Tensor:
    """A band whose root mean square is 1, or 0 where it was."""
    size = band.square().mean().sqrt()
    return band / size if size > _LEAST else torch.zeros_like(band)


def normalised_flow(flow: Float[Tensor, "x y z 3"], levels: int, gain: float = GAIN) -> Tensor:
    """The same of a flow, its components together: bands keep their direction."""
    parts = [bands(component, levels, gain) for component in flow.unbind(-1)]
    same = [unit(torch.stack(band)) for band in zip(*parts, strict=True)]
    return torch.stack([merged([b[axis] for b in same], gain) for axis in range(3)], dim=-1)


def _kernel(like: Tensor) -> Tensor:
    line = like.new_tensor(_BINOMIAL) / sum(_BINOMIAL)
    return (line[:, None, None] * line[:, None] * line)[None, None]


def _down(field: Tensor) -> Tensor:
    return functional.conv3d(field[None, None], _kernel(field), stride=2, padding=2)[0, 0]


def _up(field: Tensor, shape: torch.Size, gain: float) -> Tensor:
    odd = [n - (2 * m - 1) for n, m in zip(shape, field.shape, strict=True)]
    return functional.conv_transpose3d(
        field[None, None], gain * _kernel(field), stride=2, padding=2, output_padding=odd
    )[0, 0]
