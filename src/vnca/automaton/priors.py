"""What a cell is told about the smoke beside its neighbourhood.

Reference: VNCA section 3.3, "Encoding Priors".
"""

import numpy as np

from vnca.automaton.domain import Domain
from vnca.automaton.rule import PRIORS, Rule
from vnca.typing import FloatArray
from vnca.volume import Volume

DENSITY, VELOCITY = slice(3, 4), slice(4, 7)
"""Which priors of a cell are the density and the velocity."""
VELOCITY_LIMIT = 4.0
"""Normalised velocity is clamped here: a file in other units must not blow a state up."""
DENSITY_LIMIT = 4.0
"""Likewise for density."""


def priors(domain: Domain, smoke: Volume, rule: Rule) -> FloatArray:
    """Position, density and velocity `[n, 7]` at the cells of a domain.

    The position of a cell is (2i + 1)/H − 1 in the domain's box, −1 to 1. Priors that the rule
    switches off, and velocity where the smoke has none, are zero.
    """
    config, scales = rule.config, rule.scales
    values = np.zeros((len(domain), PRIORS), dtype=np.float32)
    if config.position_prior:
        shape = np.asarray(domain.box.shape)
        at = domain.cells - np.asarray(domain.box.lower)
        values[:, 0:3] = (2 * at + 1) / shape - 1
    if config.density_prior:
        density = domain.gather(smoke.density, smoke.origin)
        values[:, DENSITY] = np.minimum(density / scales.density, DENSITY_LIMIT)[:, None]
    if config.velocity_prior and smoke.velocity is not None:
        velocity = domain.gather(smoke.velocity, smoke.origin) / scales.velocity
        values[:, VELOCITY] = np.clip(velocity, -VELOCITY_LIMIT, VELOCITY_LIMIT)
    return values
