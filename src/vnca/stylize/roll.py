"""Rolling a rule over a sequence: state in, painting out, a frame at a time.

The state is anchored in index space and carried from frame to frame, while the cells that live
follow the smoke. Nothing but the state of the last frame is kept, so memory does not grow with
the length of a sequence.

Reference: VNCA section 3.4, "For inference, we apply N update steps …".
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from vnca.automaton.domain import Domain
from vnca.automaton.paint import colours, density_factors
from vnca.automaton.priors import priors
from vnca.automaton.rule import SMOKE_THRESHOLD, Rule
from vnca.automaton.stepper import Step
from vnca.kernels.update.mask import changing_rows
from vnca.stylize.config import StylizeConfig
from vnca.typing import Box, FloatArray
from vnca.volume import Volume

UNPAINTED = 1.0
"""Linear colour of smoke that the rule does not paint: white."""


@dataclass(frozen=True, eq=False)
class Painting:
    """One painted frame, on the same cells as its smoke.

    Attributes:
        smoke: The frame as it was read.
        density: `[x, y, z]`, painted, in the units of the file.
        colour: Linear RGB `[x, y, z, 3]`; white where the rule does not reach.
    """

    smoke: Volume
    density: FloatArray
    colour: FloatArray


def stylize(
    frames: Iterable[Volume], rule: Rule, step: Step, config: StylizeConfig, *, box: Box
) -> Iterator[Painting]:
    """Paint a sequence frame by frame.

    Args:
        frames: In order; read one at a time. A frame without smoke passes through, and the
            painting starts afresh after it.
        rule: The trained rule.
        step: The kernel that applies it.
        config: How.
        box: Holds the smoke of all frames; gives cells their position. Known from the files'
            headers before the first frame is read.
    """
    box = box.grown(rule.config.reach)
    pace = config.steps_per_frame
    if pace is None:
        pace = rule.config.steps_per_frame
    domain: Domain | None = None
    state = np.zeros((1, rule.config.channels), dtype=np.float32)
    steps_done = 0
    for smoke in frames:
        here = Domain.around_smoke(
            smoke.density,
            smoke.origin,
            threshold=SMOKE_THRESHOLD * rule.scales.density,
            reach=rule.config.reach,
            box=box,
        )
        if len(here) == 0:
            domain = None
            yield Painting(smoke, smoke.density, _unpainted(smoke))
            continue
        if domain is None:
            state, steps = here.seed(rule.config.channels), config.warmup + pace
        else:
            state, steps = domain.carry(state, here), pace
        domain = here
        told = priors(domain, smoke, rule)
        for _ in range(steps):
            rows = changing_rows(
                domain.hashes,
                seed=config.seed,
                step=steps_done,
                probability=rule.config.update_probability,
            )
            state = step(state, rows, domain.neighbours, told)
            steps_done += 1
        yield paint(smoke, domain, state, config)


def paint(smoke: Volume, domain: Domain, state: FloatArray, config: StylizeConfig) -> Painting:
    """The frame as a state shows it."""
    colour = _unpainted(smoke)
    density = smoke.density.copy()
    at = domain.cells - np.asarray(smoke.origin, dtype=np.int32)
    inside = ((at >= 0) & (at < smoke.density.shape)).all(axis=1)
    where = tuple(at[inside].T)
    cells = state[:-1][inside]
    colour[where] += config.strength * (colours(cells) - UNPAINTED)
    density[where] *= density_factors(cells, strength=config.density_strength)
    return Painting(smoke, density, colour)


def _unpainted(smoke: Volume) -> FloatArray:
    return np.full((*smoke.density.shape, 3), UNPAINTED, dtype=np.float32)
