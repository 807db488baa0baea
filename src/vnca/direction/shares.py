"""What a painting is mixed from: how much of each style of a rule, or of each of several rules."""

from collections.abc import Sequence

import numpy as np

from vnca.core import FloatArray
from vnca.direction.mixing import Answer
from vnca.direction.values import Constant, Keys, Operation, Ramp, Source, Value

_EVEN = (Constant, Keys, Operation, Ramp)


def completed(answers: Sequence[Answer], which: Sequence[int], count: int) -> FloatArray:
    """Shares of all, together 1: `[count]`, or `[n, count]` where they differ from place to place.

    The first takes what the others leave, unless it is asked for itself. What comes to more than 1,
    or to less with the first asked for, is divided by its sum. Where nothing is asked for it is the
    first.

    Args:
        answers: How much is asked for, from 0 to 1.
        which: Of which each is, from 0.
        count: Of all.
    """
    size = np.broadcast_shapes(*(np.shape(answer) for answer in answers))
    shares = np.zeros((*size, count), np.float32)
    for number, answer in zip(which, answers, strict=True):
        shares[..., number] += answer
    if 0 not in which:
        shares[..., 0] = np.maximum(0, 1 - shares.sum(-1))
    whole = shares.sum(-1, keepdims=True)
    shares[..., :1] += whole == 0
    return (shares / np.where(whole == 0, np.float32(1), whole)).astype(np.float32)


def is_even(value: Value) -> bool:
    """Whether a value is the same everywhere in a frame, whatever the frame."""
    return all(isinstance(part, _EVEN) or part == Source("frame") for part in value.parts())
