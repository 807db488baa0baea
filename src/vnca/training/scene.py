"""What a rule is trained on: cells, and how the colours they take are looked at."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np
import torch
from torch import Tensor

from vnca.core.typing import FloatArray
from vnca.engine.domain import Domain

Viewpoint = TypeVar("Viewpoint")
"""Where a scene is looked at from, to look at several states alike."""


class Scene(ABC, Generic[Viewpoint]):
    """Cells on which states are rolled out and looked at; nothing in it changes.

    Attributes:
        domain: The cells that live.
        priors: `[n, P]`, what the rule is conditioned on.
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
        """Put the cells and what they are told, `[n, P]`, where is computed."""
        self.domain, self.width = domain, width
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

    def augmented(self, slot: int) -> "Scene[Viewpoint]":
        """The scene that the state at a slot of the pool lives in, always the same cells."""
        del slot
        return self

    @abstractmethod
    def viewpoint(self, random: np.random.Generator) -> Viewpoint:
        """Where to look from in an iteration, drawn at random."""

    @abstractmethod
    def pictures(
        self, state: Tensor, viewpoint: Viewpoint, background: Tensor
    ) -> tuple[Tensor, Tensor]:
        """What a state shows, as the losses want it; differentiable in the state.

        Args:
            state: `[n + 1, C]`.
            viewpoint: Where to look from.
            background: What is behind, linear RGB `[3]`.

        Returns:
            sRGB `[b, 3, r, c]` over the background, and opacity `[b, r, c]`.
        """

    def density_pictures(
        self, state: Tensor, viewpoint: Viewpoint, background: Tensor
    ) -> Tensor | None:
        """The density that `pictures` shows coloured, in grey: sRGB `[b, 3, r, c]`.

        Differentiable in the state. None of a scene whose density is not painted.
        """
        del state, viewpoint, background
        return None

    @abstractmethod
    def preview_views(self, state: Tensor, size: int) -> list[FloatArray]:
        """Pictures for people to look at, linear RGB `[size, size, 3]`, from where they expect."""
