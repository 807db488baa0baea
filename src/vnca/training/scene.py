"""What a rule is trained on: cells, and how the colours they take are looked at."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np
import torch
from torch import Tensor

from vnca.automaton.domain import Domain
from vnca.typing import FloatArray

Sight = TypeVar("Sight")
"""Where a scene is looked at from, to look at several states alike."""


class Scene(ABC, Generic[Sight]):
    """Cells on which states are rolled out and looked at; nothing in it changes.

    Attributes:
        domain: The cells that live.
        neighbours: `[27, n]` rows of the state around each cell.
        priors: `[n, 7]`.
        samples: About how many are taken along the ray of a pixel.
        width: Cells across a picture.
        paints_density: Whether a rule may change the density. If not, its weights that would do
            so are never trained.
    """

    samples = 1.0
    paints_density = True

    def __init__(
        self, domain: Domain, priors: FloatArray, device: torch.device | str, *, width: float
    ) -> None:
        """Put the cells and what they are told, `[n, 7]`, where is computed."""
        self.domain, self.width = domain, width
        self.neighbours = torch.from_numpy(domain.neighbours).to(device)
        self.priors = torch.from_numpy(priors).to(device)
        self._places = torch.from_numpy(domain.places).to(device)

    def seed(self, channels: int) -> Tensor:
        """The state every rollout starts from, zeros `[n + 1, channels]`."""
        return torch.from_numpy(self.domain.seed(channels)).to(self.priors.device)

    def dense(self, values: Tensor) -> Tensor:
        """Values of the cells `[n, ...]` over their box `[x, y, z, ...]`; differentiable."""
        shape = self.domain.box.shape
        field = values.new_zeros(int(np.prod(shape)), *values.shape[1:])
        return field.index_copy(0, self._places, values).view(*shape, *values.shape[1:])

    def variant(self, place: int) -> "Scene[Sight]":
        """The scene that the state at a place of the pool lives in, always the same cells."""
        del place
        return self

    @abstractmethod
    def sight(self, random: np.random.Generator) -> Sight:
        """Where to look from in an iteration, drawn at random."""

    @abstractmethod
    def pictures(self, state: Tensor, sight: Sight, background: Tensor) -> tuple[Tensor, Tensor]:
        """What a state shows, as the losses want it; differentiable in the state.

        Args:
            state: `[n + 1, C]`.
            sight: Where to look from.
            background: What is behind, linear RGB `[3]`.

        Returns:
            sRGB `[b, 3, r, c]` over the background, and opacity `[b, r, c]`.
        """

    def density_pictures(self, state: Tensor, sight: Sight, background: Tensor) -> Tensor | None:
        """The density that `pictures` shows coloured, in grey: sRGB `[b, 3, r, c]`.

        Differentiable in the state. None of a scene whose density is not painted.
        """
        del state, sight, background
        return None

    @abstractmethod
    def portraits(self, state: Tensor, size: int) -> list[FloatArray]:
        """Pictures for people to look at, linear RGB `[size, size, 3]`, from where they expect."""
