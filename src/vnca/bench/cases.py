"""What is measured: smoke-shaped cells, and one step of the automaton on them."""

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from vnca.core.typing import AnyArray, BoolArray, FloatArray, Index, IntArray
from vnca.engine.automaton import FILTERS, changing_rows
from vnca.engine.domain import Domain
from vnca.rule.rule import PRIORS

CHANNELS, PROBABILITY = 12, 0.5


def smoke(shape: tuple[int, int, int], share: float, seed: int = 0) -> tuple[AnyArray, BoolArray]:
    """A ragged rising column: density, and where there is some, about a `share` of all cells."""
    rng = np.random.default_rng(seed)
    x, y, z = np.meshgrid(*(np.linspace(-1, 1, n, dtype=np.float32) for n in shape), indexing="ij")
    field = -(x**2 + z**2) / (0.35 + 0.25 * y) ** 2
    for octave in range(1, 5):
        for _ in range(3):
            direction = rng.normal(size=3) * 2.0**octave * 2
            phase = rng.uniform(0, 6)
            field += 0.7**octave * np.sin(
                direction[0] * x + direction[1] * y + direction[2] * z + phase
            ).astype(np.float32)
    threshold = np.quantile(field[::4, ::4, ::4], 1 - share)
    active = field > threshold
    return np.where(active, field - threshold, 0).astype(np.float32), active


@dataclass(frozen=True)
class Case:
    """One step, the same for every backend, and a gradient of its result.

    Attributes:
        domain: The cells that live.
        rows: `[m]` those that change.
        state: `[n + 1, C]`.
        priors: `[n, P]`.
        weights: W1, b1 and W2.
        gradient: `[n + 1, C]`.
    """

    domain: Domain
    rows: IntArray
    state: FloatArray
    priors: FloatArray
    weights: tuple[FloatArray, FloatArray, FloatArray]
    gradient: FloatArray

    @classmethod
    def draw(cls, grid: Index, hidden: int, occupancy: float) -> "Case":
        """Random values; with an occupancy under 1 only the cells of a ragged column live."""
        random = np.random.default_rng(0)

        def normal(*shape: int, scale: float = 1.0) -> FloatArray:
            return scale * random.standard_normal(shape, dtype=np.float32)

        alive = np.ones(grid, dtype=bool) if occupancy >= 1 else smoke(grid, occupancy)[1]
        domain = Domain.from_mask(alive, (0, 0, 0))
        n = len(domain)
        state = normal(n + 1, CHANNELS)
        state[-1] = 0
        inputs = FILTERS * CHANNELS + PRIORS
        return cls(
            domain,
            changing_rows(domain.hashes, seed=0, step=0, probability=PROBABILITY),
            state,
            normal(n, PRIORS),
            (
                normal(hidden, inputs, scale=0.1),
                normal(hidden, scale=0.1),
                normal(CHANNELS, hidden, scale=0.1),
            ),
            normal(n + 1, CHANNELS),
        )

    @property
    def hidden(self) -> int:
        """Hidden units."""
        return len(self.weights[1])

    @property
    def occupancy(self) -> float:
        """Share of the grid's cells that live."""
        return len(self.domain) / float(np.prod(self.domain.box.shape))

    def rounded(self, dtype: torch.dtype) -> "Case":
        """With values that a dtype can hold: what is compared is arithmetic, not input."""

        def near(array: FloatArray) -> FloatArray:
            return torch.from_numpy(array).to(dtype).float().numpy()

        hidden, bias, output = map(near, self.weights)
        return dataclasses.replace(
            self,
            state=near(self.state),
            priors=near(self.priors),
            weights=(hidden, bias, output),
            gradient=near(self.gradient),
        )


class Place(NamedTuple):
    """Where a backend computes, and with which numbers."""

    device: str
    dtype: torch.dtype

    def tensor(self, values: FloatArray | Tensor) -> Tensor:
        """A copy there."""
        return torch.as_tensor(values).to(self.device, self.dtype, copy=True)
