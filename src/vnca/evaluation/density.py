"""What a painting does to the smoke itself."""

from typing import NamedTuple

import numpy as np

from vnca.stylize.roll import Painting


class DensityChange(NamedTuple):
    """How the density of a painted frame differs from that of the smoke.

    Attributes:
        moved: Σ|d' − d| / Σd: the share of the mass that is taken away or added.
        mass_change: Σd' / Σd − 1: what this comes to in total.
    """

    moved: float
    mass_change: float

    @classmethod
    def of(cls, painting: Painting) -> "DensityChange":
        """That of a painted frame; nothing changes in one without smoke."""
        before, after = (
            density.astype(np.float64) for density in (painting.smoke.density, painting.density)
        )
        mass = before.sum() or 1.0
        return cls(
            moved=float(np.abs(after - before).sum() / mass),
            mass_change=float((after.sum() - before.sum()) / mass),
        )
