"""The terms of the loss: what each iteration of a training is judged by, one after the other.

Among them motion supervision: the painted texture is taught to move as the smoke does. The density
stays that of one frame while texture moves in it, so that nothing but the texture can be what an
optical flow network sees moving.

Reference: VNCA section 3.4, "Flow-guided Motion Supervision".
"""

import math
import statistics
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from vnca.features.flow import FlowNetwork
from vnca.losses import (
    Motion,
    MotionConfig,
    compare_motion,
    luma,
    motion_loss,
    overflow,
    supervised,
)
from vnca.losses.appearance import AppearanceConfig, AppearanceLoss
from vnca.rule import DENSITY_CHANGE
from vnca.training import Snapshot
from vnca.training.scenes import Scene
from vnca.training.scenes.flat import FlatScene
from vnca.training.scenes.smoke import SmokeScene
from vnca.training.styles import WHOLE, Judged


@dataclass(frozen=True, eq=False)
class Iteration:
    """What an iteration shows, for the terms of the loss to judge.

    Attributes:
        before: The state at the start of the rollout, `[n + 1, C]`.
        kept: What is to be kept of it: as it was before carrying wore it, alike.
        after: The state at its end, alike; differentiable.
        age: Rollouts that the state had been through before, in what styles are asked for now.
        frames: Frames that pass in the rollout: its steps over those of a frame.
        scene: That the rollout was in, as it is augmented.
        viewpoint: Where the pictures were taken from.
        pictures: Of the end of the rollout, sRGB `[b, 3, r, c]` over the background;
            differentiable.
        opacity: `[b, r, c]`.
        background: Linear RGB `[3]`.
        sums: What the terms before this one came to, weighted, by their names.
        judged: By which style picture, and where; by the first, everywhere, unless told.
    """

    before: Tensor
    kept: Tensor
    after: Tensor
    age: int
    frames: float
    scene: Scene[Any]
    viewpoint: Any
    pictures: Tensor
    opacity: Tensor
    background: Tensor
    sums: Mapping[str, Tensor]
    judged: Judged = WHOLE


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

    def __init__(self, losses: Sequence[AppearanceLoss], generator: torch.Generator) -> None:
        """Judge by the loss of a style; the generator draws its positions."""
        self._losses, self._generator = losses, generator

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """Those of the loss that have a weight."""
        style, where = seen.judged
        loss, opacity = self._losses[style], seen.opacity
        if where is not None:
            opacity = opacity * where
        grey = None
        if loss.config.shows_density:
            grey = seen.scene.density_pictures(seen.after, seen.viewpoint, seen.background)
        return loss(seen.pictures, opacity, self._generator, grey).terms


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


GROWN = 2
"""Rollouts after which a state has grown its pattern, which is then to be kept."""
_LEAST_VARIANCE = 1e-4
_LEAST_CONTRAST = 1e-2  # of colours: what is seen to be paler than that is not kept so


class Balance:
    """The appearance losses of the latest iterations, by whose median other terms are weighted."""

    def __init__(self, over: int) -> None:
        """Take the median of so many; with none of them it is 1."""
        self.losses: deque[float] = deque(maxlen=over)

    def after(self, appearance: float) -> float:
        """The median, with the appearance loss of this iteration."""
        if math.isfinite(appearance):
            self.losses.append(appearance)
        return statistics.median(self.losses) if self.losses else 1.0

    def snapshot(self) -> Snapshot:
        """The losses."""
        return Snapshot(values={"appearance": list(self.losses)})

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot.

        Raises:
            KeyError, TypeError, ValueError: If it is not one of a balance.
        """
        losses = [float(loss) for loss in snapshot.values["appearance"]]
        if not all(map(math.isfinite, losses)):
            raise ValueError("appearance: not all finite")
        self.losses = deque(losses, maxlen=self.losses.maxlen)


class Keeping(Term):
    """What a rollout changes of a grown state: squared differences over the variance."""

    def __init__(self, weight: float) -> None:
        """Weight it relative to the appearance loss."""
        self._weight = weight
        self._balance = Balance(25)

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """Nothing for a state that still grows."""
        balance = self._balance.after(float(seen.sums["appearance"].detach()))
        if seen.age < GROWN:
            return {}
        return {self.name: self._weight * balance * self.change(seen)}

    @abstractmethod
    def change(self, seen: Iteration) -> Tensor:
        """How much it changes: 0 nothing, 2 all of it. Differentiable in what is after it."""

    def snapshot(self) -> Snapshot:
        """What its weight is balanced by."""
        return self._balance.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of such a term."""
        self._balance.restore(snapshot)


class SteadinessTerm(Keeping):
    """How much of the state itself changes."""

    name = "steadiness"

    def change(self, seen: Iteration) -> Tensor:
        """Of all cells, but for those that nothing was carried to: they are left to grow."""
        kept, after = seen.kept[:-1], seen.after[:-1]
        variance = (kept - kept.mean(0)).square().mean().clamp_min(_LEAST_VARIANCE)
        grown = kept.any(1, keepdim=True)
        return ((after - kept) * grown).square().mean() / variance


class ConsistencyTerm(Keeping):
    """How much of what is seen changes: small changes of a state may move large strokes.

    Reference: Ruder et al. 2016 (temporal consistency loss), of a state as the smoke carries it.
    """

    name = "consistency"

    def change(self, seen: Iteration) -> Tensor:
        """Of the pixels that show mostly smoke."""
        # Cells that nothing was carried to are left to grow.
        kept = torch.where(seen.kept.any(1, keepdim=True), seen.kept, seen.after.detach())
        with torch.no_grad():
            before, _ = seen.scene.pictures(kept, seen.viewpoint, seen.background)
            shown = (seen.opacity > AppearanceConfig.opacity_threshold)[:, None].to(before)
            pixels = shown.sum().clamp_min(1)
            mean = (before * shown).sum((0, 2, 3), keepdim=True) / pixels
            variance = ((before - mean).square() * shown).sum().clamp_min(_LEAST_CONTRAST * pixels)
        return ((seen.pictures - before).square() * shown).sum() / variance


class MassTerm(Term):
    """How much of the smoke appears or disappears."""

    name = "mass"

    def __init__(self, weight: float) -> None:
        """Weight the square of the change."""
        self._weight = weight

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """Of the state at the end of the rollout."""
        assert isinstance(seen.scene, SmokeScene), "only smoke has a mass"
        return {"mass": self._weight * seen.scene.mass_change(seen.after).square()}


class MotionSupervision(Term):
    """Judges how the pictures before and after a rollout differ.

    Attributes:
        name: "motion".
        config: What is compared, and how strongly.
        balance: What its weight is relative to.
    """

    name = "motion"

    def __init__(self, config: MotionConfig, network: FlowNetwork) -> None:
        """Prepare; `network` is frozen."""
        self.config = config
        self.balance = Balance(config.balance_over)
        self._network = network

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """The motion loss; nothing for a state of zeros, which has no texture to move."""
        if not seen.before.any():
            return {}
        appearance = float(seen.sums["appearance"].detach())
        assert isinstance(seen.scene, SmokeScene | FlatScene), "nothing else moves"
        loss = self.loss(
            seen.scene,
            seen.before,
            seen.pictures,
            seen.viewpoint,
            seen.background,
            frames=seen.frames,
            appearance=appearance,
        )
        return {"motion": loss}

    def loss(
        self,
        scene: SmokeScene | FlatScene,
        before: Tensor,
        after: Tensor,
        viewpoint: Any,
        background: Tensor,
        *,
        frames: float,
        appearance: float,
    ) -> Tensor:
        """How the texture moved in a rollout, against how it is to in that time, weighted.

        Args:
            scene: That the rollout was in.
            before: The state at its start, `[n + 1, C]`.
            after: Pictures of its end, sRGB `[b, 3, r, c]`, of which the first is compared;
                differentiable.
            viewpoint: Where they were taken from.
            background: What is behind, linear RGB `[3]`.
            frames: Frames that pass in the rollout, n / N.
            appearance: The appearance loss of this iteration.
        """
        with torch.no_grad():
            earlier, _ = scene.pictures(before, viewpoint, background)
        earlier, after = earlier[:1], after[:1]
        size = min(self.config.size, after.shape[-1])
        target, opacity = scene.motion(before, viewpoint, size)
        motion = self.compare(earlier, after, target, opacity, frames=frames)
        return self.weighted(motion, appearance)

    def compare(
        self,
        before: Tensor,
        after: Tensor,
        target: Tensor,
        opacity: Tensor,
        *,
        frames: float,
    ) -> Motion:
        """How far the motion seen between two pictures is from its target.

        Differentiable in both pictures.

        Args:
            before: sRGB `[1, 3, r, c]` at the start of a rollout.
            after: The same view at its end.
            target: The smoke's projected velocity `[s, s, 2]`, pixels per frame.
            opacity: Opacity of the same view `[s, s]`.
            frames: Frames that pass in the rollout, n / N.
        """
        grey = (_shrunk(luma(picture)[:, 0], target.shape[0]) for picture in (before, after))
        seen = self._network(*grey)[0].permute(1, 2, 0) / frames
        return compare_motion(seen, target, supervised(target, opacity, self.config))

    def weighted(self, motion: Motion, appearance: float) -> Tensor:
        """The motion loss, balanced against the appearance losses of the latest iterations."""
        balance = self.balance.after(appearance)
        return self.config.weight * balance * motion_loss(motion, self.config)

    def snapshot(self) -> Snapshot:
        """The losses on which the weight is balanced."""
        return self.balance.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of motion supervision."""
        self.balance.restore(snapshot)


def _shrunk(pictures: Tensor, size: int) -> Tensor:
    """Pictures `[b, r, c]` as `[b, size, size]`, each pixel the mean of the area it covers.

    As a product of matrices, whose gradient is the same in every run on a GPU too.
    """
    rows, columns = (_averages(n, size).to(pictures) for n in pictures.shape[1:])
    return rows @ pictures @ columns.T


def _averages(many: int, few: int) -> Tensor:
    """The matrix `[few, many]` that averages a row of pixels into a shorter one."""
    edges = torch.arange(few + 1) * (many / few)
    pixel = torch.arange(many)
    covered = (edges[1:, None] - pixel).clamp(0, 1) - (edges[:-1, None] - pixel).clamp(0, 1)
    return covered * (few / many)
