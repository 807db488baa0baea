"""Smoke too thin to be painted, as with densities in another unit than the rule was taught in."""

from collections.abc import Iterable

from vnca.core.errors import SequenceError
from vnca.core.typing import FloatArray
from vnca.rule.rule import SMOKE_THRESHOLD, density_scale


def require_dense(densities: Iterable[FloatArray], scale: float, where: str) -> None:
    """Refuse a sequence of which nothing would be painted.

    Looks at frames up to the first that is dense enough; of none at all nothing is said.

    Args:
        densities: Of each frame, in any shape.
        scale: The density that counts as 1.
        where: What a message calls the sequence.

    Raises:
        SequenceError: If no frame holds a cell that counts as smoke.
    """
    most, typical, is_read = 0.0, 0.0, False
    for density in densities:
        is_read = True
        most = max(most, float(density.max(initial=0)))
        if most > SMOKE_THRESHOLD * scale:
            return
        if density.any():
            typical = max(typical, density_scale(density))
    if is_read:
        raise SequenceError(
            f"{where}: nothing would be painted, as the greatest density of all frames, "
            f"{most:.3g}, is below {SMOKE_THRESHOLD:.0%} of the one that counts as 1, "
            f"{scale:.3g}; "
            + (f"try `density_scale` {typical:.3g}" if most else "choose others with `frames`")
        )
