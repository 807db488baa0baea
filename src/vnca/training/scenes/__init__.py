"""What a rule is trained on: cells, and how the colours they take are looked at."""

import copy
from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np
import torch
from torch import Tensor

from vnca.core import FloatArray
from vnca.engine import torch_decode
from vnca.engine.automaton import DecoderWeights
from vnca.engine.carrying import carried
from vnca.engine.domain import Domain
from vnca.rendering import native
from vnca.rendering.colour import srgb_to_linear
from vnca.rule import COLOUR, DENSITY_CHANGE, DENSITY_LIMIT, Decoder

Viewpoint = TypeVar("Viewpoint")
"""Where a scene is looked at from, to look at several states alike."""


class Scene(ABC, Generic[Viewpoint]):
    """Cells on which states are rolled out and looked at; nothing in it changes.

    Attributes:
        domain: The active cells.
        priors: `[n, P]`, what the rule is conditioned on.
        decoder: What is seen between cells, tensors that can be trained; None where states are
            interpolated.
        samples: About how many are taken along the ray of a pixel.
        width: Cells across a picture.
        dimensions: In a layer of two, the weights of the gradient along y are never trained.
        paints_density: Whether a rule may change the density. If not, its weights that would do
            so are never trained.
    """

    samples = 1.0
    dimensions = 3
    paints_density = True

    def __init__(
        self,
        domain: Domain,
        priors: FloatArray,
        device: torch.device | str,
        *,
        width: float,
        decoder: Decoder | None = None,
        backend: str = "auto",
    ) -> None:
        """Put the cells, their priors `[n, P]` and the decoder on the device.

        Args:
            domain: The active cells.
            priors: `[n, P]`.
            device: Where rollouts and pictures are computed.
            width: Cells across a picture.
            decoder: What is seen between cells; states are interpolated unless given.
            backend: What decodes.
        """
        self.domain, self.width = domain, width
        self.priors = torch.from_numpy(priors).to(device)
        self._places = torch.from_numpy(domain.places).to(device)
        self.decoder: DecoderWeights | None = None
        if decoder is not None:
            self.decoder = DecoderWeights(
                *(torch.tensor(w, device=device) for w in decoder.weights)
            )
            self._decode = torch_decode(backend, device=self.priors.device.type)
            self._rows, self._beside = _table(domain, device)

    def seed(self, channels: int) -> Tensor:
        """The state every rollout starts from, zeros `[n + 1, channels]`."""
        return torch.from_numpy(self.domain.seed(channels)).to(self.priors.device)

    def dense(self, values: Tensor) -> Tensor:
        """Values of the cells `[n, ...]` over their box `[x, y, z, ...]`; differentiable."""
        shape = self.domain.box.shape
        field = values.new_zeros(int(np.prod(shape)), *values.shape[1:])
        return field.index_copy(0, self._places, values).view(*shape, *values.shape[1:])

    def seen(self, state: Tensor, points: Tensor) -> Tensor:
        """What a state shows between its cells, `[m, 4]`: sRGB minus one half, and Δd.

        Differentiable in the state and the decoder, which there must be.

        Args:
            state: `[n + 1, C]`.
            points: `[m, 3]` in the box; its first cell is at (0, 0, 0).
        """
        assert self.decoder is not None
        if self.domain.border == "circular":
            size = points.new_tensor(self.domain.box.shape)
            points = points.remainder(size)
            points = torch.where(points < size, points, 0)  # just below zero rounds to the size
        first = points.floor()
        shape = self._rows.shape
        # The table begins a cell before the box.
        strides = first.new_tensor([shape[1] * shape[2], shape[2], 1]).long()
        lowest = ((first.long() + 1) * strides).sum(-1)
        rows = self._rows.view(-1)[lowest + self._beside]
        return self._decode(state, rows, points - first, self.decoder)

    def augmented(self, number: int) -> "Scene[Viewpoint]":
        """A scene of the same cells that a state of the pool leads its life in, by a number."""
        del number
        return self

    def in_shares(self, shares: Tensor, columns: slice) -> "Scene[Viewpoint]":
        """A scene of the same cells in which a rule of several styles mixes them.

        Args:
            shares: Of each style, `[K]` or `[n, K]`.
            columns: Where in the priors they stand.
        """
        scene = copy.copy(self)
        scene.priors = self.priors.clone()
        scene.priors[:, columns] = shares
        return scene

    @abstractmethod
    def seen_shares(self, shares: Tensor, viewpoint: Viewpoint) -> Tensor:
        """Of what is seen in each pixel of `pictures`, `[b, r, c]`, the part that a field has.

        Not a number where nothing is seen.

        Args:
            shares: The field, `[n]`, from 0 to 1.
            viewpoint: Where to look from.
        """

    def transported(self, state: Tensor, random: np.random.Generator) -> tuple[Tensor, Tensor]:
        """A state carried along for a random part of a frame, and worn by being carried.

        So a rule meets what painting makes of its states between frames. The second has been
        carried back and forth once more: as each time takes some of what is fine, a rule that
        makes the first of the second learns to give back what carrying takes. No gradient flows
        through either.
        """
        moved = random.uniform() * self.drift(random)
        carried = self._carried(state, moved)
        return carried, self._carried(self._carried(carried, -moved), moved)

    @abstractmethod
    def drift(self, random: np.random.Generator) -> FloatArray:
        """By how many cells a frame carries a state, `[n, 3]` or `[3]` the same everywhere."""

    @torch.no_grad()
    def _carried(self, state: Tensor, moved: FloatArray) -> Tensor:
        moved = np.ascontiguousarray(np.broadcast_to(moved, (len(self.domain), 3)), np.float32)
        if state.device.type == "cpu":
            values = carried(state.detach().numpy(), self.domain, self.domain, moved)
            return torch.from_numpy(values)
        rows, shares = map(torch.from_numpy, self.domain.sources(self.domain, moved))
        result = torch.zeros_like(state)
        for row, share in zip(rows.to(state.device), shares.to(state.device), strict=True):
            result[:-1] += share[:, None] * state[row]
        return result

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


def _table(domain: Domain, device: torch.device | str) -> tuple[Tensor, Tensor]:
    """Rows of the state over the box and a cell beyond; and how far apart a point's corners are.

    Returns:
        `[x + 2, y + 2, z + 2]`, n for the outside; and `[8, 1]` places in it, laid out flat.
    """
    rows = np.full(domain.box.shape, len(domain), np.int32)
    rows.reshape(-1)[domain.places] = np.arange(len(domain), dtype=np.int32)
    rows = np.pad(rows, 1, mode="wrap" if domain.border == "circular" else "edge")
    corners = np.ravel_multi_index(tuple(np.indices((2, 2, 2)).reshape(3, 8)), rows.shape)
    return torch.from_numpy(rows).to(device), torch.from_numpy(corners)[:, None].to(device)


def colours(seen: Tensor) -> Tensor:
    """Linear RGB `[..., 3]` of states, or of what is seen of them, `[..., C]`; differentiable."""
    return srgb_to_linear((seen[..., COLOUR] + 0.5).clamp(0, 1))


def density_factors(seen: Tensor) -> Tensor:
    """1 + Δd `[...]` of states, or of what is seen of them, `[..., C]`; differentiable."""
    return 1 + seen[..., DENSITY_CHANGE].clamp(-DENSITY_LIMIT, DENSITY_LIMIT)


def as_light(seen: Tensor) -> tuple[Tensor, Tensor]:
    """`colours` `[m, 3]` and `density_factors` `[m]` of what a decoder shows `[m, 4]`."""
    if native.serves(seen):  # as quick as one of its torch operations
        return native.shown(seen, DENSITY_LIMIT)
    return colours(seen), density_factors(seen)
