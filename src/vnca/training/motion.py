"""Motion supervision: the painted texture is taught to move as the smoke does.

The density stays that of one frame while texture moves in it, so that nothing but the texture
can be what an optical flow network sees moving.

Reference: VNCA section 3.4, "Flow-guided Motion Supervision".
"""

import math
import statistics
from collections import deque

import torch
from torch import Tensor

from vnca.features.flow import FlowNetwork
from vnca.losses.motion import Motion, MotionConfig, compare_motion, motion_loss, supervised
from vnca.losses.terms import luma
from vnca.training.scenes.smoke import SmokeScene, SmokeViewpoint
from vnca.training.snapshot import Snapshot
from vnca.training.terms import Iteration, Term


class MotionSupervision(Term):
    """Judges how the pictures before and after a rollout differ.

    Attributes:
        name: "motion".
        config: What is compared, and how strongly.
        appearance: The latest appearance losses, on which the weight of motion is balanced.
    """

    name = "motion"

    def __init__(self, config: MotionConfig, network: FlowNetwork) -> None:
        """Prepare; `network` is frozen."""
        self.config = config
        self.appearance: deque[float] = deque(maxlen=config.balance_over)
        self._network = network

    def __call__(self, seen: Iteration) -> dict[str, Tensor]:
        """The motion loss; nothing for a state of zeros, which has no texture to move."""
        if not seen.before.any():
            return {}
        appearance = float(seen.sums["appearance"].detach())
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
        scene: SmokeScene,
        before: Tensor,
        after: Tensor,
        viewpoint: SmokeViewpoint,
        background: Tensor,
        *,
        frames: float,
        appearance: float,
    ) -> Tensor:
        """How the texture moved in a rollout, against how the smoke moves in that time, weighted.

        Args:
            scene: That the rollout was in.
            before: The state at its start, `[n + 1, C]`.
            after: The picture of its end, sRGB `[1, 3, r, c]`; differentiable.
            viewpoint: Where the picture was taken from.
            background: What is behind, linear RGB `[3]`.
            frames: Frames that pass in the rollout, n / N.
            appearance: The appearance loss of this iteration.
        """
        with torch.no_grad():
            earlier, _ = scene.pictures(before, viewpoint, background)
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
        if math.isfinite(appearance):
            self.appearance.append(appearance)
        balance = statistics.median(self.appearance) if self.appearance else 1.0
        return self.config.weight * balance * motion_loss(motion, self.config)

    def snapshot(self) -> Snapshot:
        """The losses on which the weight is balanced."""
        return Snapshot(values={"appearance": list(self.appearance)})

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot.

        Raises:
            KeyError, TypeError, ValueError: If it is not one of motion supervision.
        """
        losses = [float(loss) for loss in snapshot.values["appearance"]]
        if not all(map(math.isfinite, losses)):
            raise ValueError("appearance: not all finite")
        self.appearance = deque(losses, maxlen=self.config.balance_over)


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
