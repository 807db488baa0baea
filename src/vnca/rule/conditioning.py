"""What a cell is conditioned on beside its neighbourhood.

Reference: VNCA section 3.3, "Encoding Priors".
"""

import numpy as np

from vnca.core.lattice import Placement
from vnca.core.typing import FloatArray
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.rule.rule import PRIORS, Rule

POSITION, DENSITY, VELOCITY = slice(0, 3), slice(3, 4), slice(4, 7)
"""Which priors of a cell are which."""
SPEED_LIMIT = 2.0
"""No cell is conditioned on a normalised speed above this: training has hardly met faster smoke,
and what a rule has not met it paints badly. Nor must a file in other units blow a state up."""
DENSITY_LIMIT = 4.0
"""Nor on a greater normalised density."""
_SQUARABLE = 1e18
"""Single precision holds the square of it."""


def priors(domain: Domain, smoke: Volume, rule: Rule) -> FloatArray:
    """Position, density and velocity `[n, 7]` at the cells of a domain.

    The position of a cell is (2i + 1)/H − 1, −1 to 1, in the box where the rule was trained; what
    lies outside counts as at its border. Of a rule that does not know where that was, it is
    the domain's box. Priors that the rule switches off, and velocity where the smoke has none, are
    zero.
    """
    config, scales = rule.config, rule.scales
    values = np.zeros((len(domain), PRIORS), dtype=np.float32)
    if config.position_prior:
        values[:, POSITION] = _positions(domain, smoke, rule)
    if config.density_prior:
        density = smoke.density_field.gather(domain.cells)
        values[:, DENSITY] = np.minimum(density / scales.density, DENSITY_LIMIT)[:, None]
    if smoke.velocity_field is not None:
        values[:, VELOCITY] = normalised_velocity(smoke.velocity_field.gather(domain.cells), rule)
    return values


def _positions(domain: Domain, smoke: Volume, rule: Rule) -> FloatArray:
    box, cells = domain.box, domain.cells
    if rule.place is not None:
        there = rule.place.lattice.to_world
        place = Placement.between(smoke.index_to_world, there, domain.box, f"frame {smoke.frame}")
        box, cells = rule.place.box, place.cells(cells)
    at = (2 * (cells - np.asarray(box.lower)) + 1) / np.asarray(box.shape) - 1
    return np.clip(at, -1, 1).astype(np.float32)


def normalised_velocity(velocity: FloatArray, rule: Rule) -> FloatArray:
    """What cells are conditioned on of a velocity `[n, 3]`, cells per frame, limited in speed.

    Zero if the rule switches it off.
    """
    if not rule.config.velocity_prior:
        return np.zeros_like(velocity)
    told = np.clip(velocity / rule.scales.velocity, -_SQUARABLE, _SQUARABLE)
    speed = np.linalg.norm(told, axis=-1, keepdims=True)
    return told * (SPEED_LIMIT / np.maximum(speed, SPEED_LIMIT))
