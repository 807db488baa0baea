"""What the machine can do at most: the roofs of a roofline, measured in the same run."""

from collections.abc import Callable
from typing import NamedTuple

import torch

from vnca.bench.cases import Place


class Peak(NamedTuple):
    """Work that nothing on the machine does faster.

    Attributes:
        work: One call of it.
        amount: Floating-point operations, or bytes read and written.
    """

    work: Callable[[], object]
    amount: float

    def begin(self) -> Callable[[], object]:
        """Nothing has to be done before."""
        return self.work


def gemm(place: Place) -> Peak:
    """A product of square matrices."""
    size = 1024 if place.device == "cpu" else 8192
    left, right, product = (place.tensor(torch.rand(size, size)) for _ in range(3))
    return Peak(lambda: torch.mm(left, right, out=product), 2.0 * size**3)


def copying(place: Place) -> Peak:
    """A copy between two arrays that no cache holds."""
    size = 1 << (27 if place.device == "cpu" else 30)
    source, target = (torch.ones(size, dtype=torch.uint8, device=place.device) for _ in range(2))
    return Peak(lambda: target.copy_(source), 2.0 * size)
