"""How near painted smoke comes to the style picture in the eyes of frozen networks.

One of them may be the network that the rule was trained to please, so there are several, and each
says whether it is the one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from vnca.colour import linear_to_srgb
from vnca.evaluation.stage import Pair
from vnca.evaluation.style import StyleGauge, gap_closed
from vnca.features.network import SMALLEST, FeatureNetwork
from vnca.losses.appearance import AppearanceConfig, AppearanceLoss
from vnca.typing import AnyArray, BoolArray

_SEED = 0


@dataclass
class Judge:
    """A network that compares what is opaque in views with the style picture.

    Attributes:
        name: What it is called.
        trained_with: Whether the rule was trained with it; None if its file does not tell.
        reason: Why it cannot judge, if it cannot.
        shares: The share of the gap closed, by frame.
    """

    name: str
    trained_with: bool | None
    reason: str = ""
    shares: dict[int, float] = field(default_factory=dict)
    _loss: AppearanceLoss | None = None

    @classmethod
    def of(
        cls, network: FeatureNetwork, trained_with: bool | None, gauge: StyleGauge, size: int
    ) -> "Judge":
        """A judge of views.

        Args:
            network: What compares.
            trained_with: Whether the rule was trained with it.
            gauge: Has the picture, as large as it is to be compared.
            size: Rows and columns of the views.
        """
        shorter = min(gauge.picture.shape[:2])
        config = AppearanceConfig(pixels=0.0, grey=False, style_scale=shorter / size)
        loss = AppearanceLoss(network, gauge.picture, config, size)
        return cls(network.name, trained_with, _loss=loss)

    def look(self, frame: int, pairs: Sequence[Pair], gauge: StyleGauge) -> None:
        """Judge views of a frame, as `likeness` does by measures that never learned.

        A view counts as far as both ways of the smoke are opaque in it.
        """
        pairs = [pair for pair in pairs if pair.where.any()]
        if self._loss is None or not pairs:
            return
        behind = gauge.background
        painted, plain, cutout = (
            float(np.mean([self._distance(*one) for one in some]))
            for some in (
                [(pair.painted.over(behind), pair.where) for pair in pairs],
                [(pair.plain.over(behind), pair.where) for pair in pairs],
                [
                    part
                    for seed, pair in enumerate(pairs)
                    for part in gauge.cutouts(pair.where, 1, seed)
                ],
            )
        )
        self.shares[frame] = gap_closed([painted], [plain], [cutout])

    @torch.no_grad()
    def _distance(self, picture: AnyArray, where: BoolArray) -> float:
        """Styles and moments apart, summed over the layers."""
        assert self._loss is not None
        lacking = [(0, max(0, SMALLEST - side)) for side in where.shape]
        encoded = linear_to_srgb(np.pad(picture, [*lacking, (0, 0)]).clip(0, 1)).astype(np.float32)
        shown = torch.from_numpy(encoded).permute(2, 0, 1)[None]
        opacity = torch.from_numpy(np.pad(where, lacking).astype(np.float32))[None]
        # The same positions are drawn for all.
        return float(self._loss(shown, opacity, torch.Generator().manual_seed(_SEED)).total)
