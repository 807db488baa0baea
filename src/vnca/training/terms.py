"""The terms of the loss: what each iteration of a training is judged by, one after the other."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from vnca.losses.appearance import AppearanceLoss
from vnca.losses.terms import overflow
from vnca.rule.rule import DENSITY_CHANGE
from vnca.training.scene import Scene
from vnca.training.snapshot import Snapshot


@dataclass(frozen=True, eq=False)
class Iteration:
    """What an iteration shows, for the terms of the loss to judge.

    Attributes:
        before: The state at the start of the rollout, `[n + 1, C]`.
        after: The state at its end, alike; differentiable.
        frames: Frames that pass in the rollout: its steps over those of a frame.
        scene: That the rollout was in, as it is augmented.
        viewpoint: Where the pictures were taken from.
        pictures: Of the end of the rollout, sRGB `[b, 3, r, c]` over the background;
            differentiable.
        opacity: `[b, r, c]`.
        background: Linear RGB `[3]`.
        sums: What the terms before this one came to, weighted, by their names.
    """

    before: Tensor
    after: Tensor
    frames: float
    scene: Scene[Any]
    viewpoint: Any
    pictures: Tensor
    opacity: Tensor
    background: Tensor
    sums: Mapping[str, Tensor]


class Term(ABC):
    """A part of the loss, with its weight.

    Attributes:
        name: No two terms of a training share one.
    """

    name: str

    @abstractmethod
    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """Weighted losses of an iteration by what the loss curves call them, each a scalar.

        Differentiable in what of `seen` is. Nothing if the term has no say in this iteration.
        """

    def snapshot(self) -> Snapshot | None:
        """What the term remembers from one iteration to the next, for a checkpoint, if anything."""
        return None

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of such a term.

        Raises:
            KeyError, TypeError, ValueError: If it is not one.
        """
        del snapshot


class AppearanceTerm(Term):
    """How far the pictures are from the style picture."""

    name = "appearance"

    def __init__(self, loss: AppearanceLoss, generator: torch.Generator) -> None:
        """Judge by a loss; the generator draws its positions."""
        self._loss, self._generator = loss, generator

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """Style, moments and palette."""
        grey = None
        if self._loss.config.shows_density:
            grey = seen.scene.density_pictures(seen.after, seen.viewpoint, seen.background)
        return self._loss(seen.pictures, seen.opacity, self._generator, grey).terms


class OverflowTerm(Term):
    """How far states are out of range."""

    name = "overflow"

    def __init__(self, weight: float) -> None:
        """Weight the penalty."""
        self._weight = weight

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """Beyond ±1, and beyond ±½ where states are shown: a clamped colour learns nothing."""
        cells = seen.after[:-1]
        return {
            "overflow": self._weight
            * (overflow(cells) + overflow(2 * cells[:, : DENSITY_CHANGE + 1]))
        }
