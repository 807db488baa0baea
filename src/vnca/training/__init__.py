"""A training at rest, as data: what it takes to go on from there as if nothing had happened."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor


@dataclass(frozen=True)
class Snapshot:
    """What one part of a training remembers.

    Every part has a method `snapshot` that gives one, and a method `restore` that takes it back
    and raises a `ValueError`, `TypeError` or `KeyError` if it is not one of its own.

    Attributes:
        tensors: By name; nobody may change them in place.
        values: Whatever JSON can hold.
    """

    tensors: Mapping[str, Tensor] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)


def matched(tensor: Tensor, like: Tensor, name: str) -> Tensor:
    """`tensor` where `like` is.

    Raises:
        ValueError: If shape or type differ from those of `like`, or a value is not finite.
    """
    if tensor.shape != like.shape or tensor.dtype != like.dtype:
        expected, got = ((tuple(t.shape), t.dtype) for t in (like, tensor))
        raise ValueError(f"{name}: expected {expected}, got {got}")
    if not bool(torch.isfinite(tensor).all()):
        raise ValueError(f"{name}: not all finite")
    return tensor.to(like.device)


def count(value: Any, name: str, *, most: float = 2**53) -> int:
    """`value`, which must be a whole number from 0 to `most`.

    Raises:
        ValueError: If it is not.
    """
    if type(value) is not int or not 0 <= value <= most:
        raise ValueError(f"{name}: expected a number from 0 to {most:g}, got {value!r}")
    return value
