"""What a rule of several styles is asked to paint in, rollout by rollout of a state's life.

Most rollouts are asked for one style. Others mix two: evenly, as a cross-fade does midway, or over
a smooth mask, so that their patterns learn to grow into each other. What is asked for changes
within a life, so that a pattern learns to become another.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from torch import Tensor

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.engine.automaton import OFFSETS
from vnca.engine.domain import Domain
from vnca.rule.conditioning import STYLES
from vnca.training.config import TrainingConfig
from vnca.training.scenes import Scene

CHANGED = 0.3
"""Chance that a rollout is asked for something else than the one before it in the same life."""
EVEN, MASKED = 0.15, 0.25
"""Share of what is asked for that mixes two styles evenly, and over a mask."""
SHARPNESS = (0.5, 8.0)
"""Of a mask: at 1 it goes from one style to the other in a sixth of the box along a wave, at 8 in a
few cells."""


C = TypeVar("C", bound=TrainingConfig)


def told_styles(config: C, style: FloatArray | Sequence[FloatArray]) -> C:
    """The hyperparameters with a rule that is told the shares of several styles.

    Args:
        config: The hyperparameters.
        style: The pictures, or the only one.

    Raises:
        OptionError: If they are too many, or the rule is told the shares of others.
    """
    count = 1 if isinstance(style, np.ndarray) else len(style)
    if not 1 <= count <= len(STYLES):
        raise OptionError(f"`style`: {count} pictures; expected 1 to {len(STYLES)}")
    wanted, told = (count if count > 1 else 0), config.rule.style_count
    if told not in (0, wanted):
        raise OptionError(f"`conditioning`: has the shares of {told} styles; there are {count}")
    conditioning = (*config.rule.conditioning, *STYLES[told:wanted])
    return replace(config, rule=replace(config.rule, conditioning=conditioning))


def shared_out(config: C, count: int) -> C:
    """The hyperparameters of a training on so many pictures: √K times as many iterations.

    An iteration is of one picture or two; what is common to all of them is learnt once.
    """
    return replace(config, iterations=round(config.iterations * math.sqrt(count)))


class Judged(NamedTuple):
    """By which picture an iteration is judged, and where.

    Attributes:
        style: Number of the picture.
        where: `[b, r, c]`, the pixels that are; None for all.
    """

    style: int
    where: Tensor | None


WHOLE = Judged(0, None)
"""All of what is seen, by the first picture."""


@dataclass(frozen=True, eq=False)
class Mix:
    """What a rollout is asked to paint in: two styles, or one.

    Attributes:
        first: Number of a style.
        second: Number of another.
        share: Of the second, from 0 to 1, everywhere or in each cell `[n]`.
        age: Rollouts of the same life before it that were asked for the same.
    """

    first: int
    second: int
    share: float | FloatArray
    age: int

    def asked(self, scene: Scene[Any], columns: slice) -> Scene[Any]:
        """A scene in which the rule is told so, in some columns of its priors."""
        size = self.share.shape if isinstance(self.share, np.ndarray) else ()
        shares = np.zeros((*size, columns.stop - columns.start), np.float32)
        shares[..., self.second] = self.share
        shares[..., self.first] = 1 - shares[..., self.second]
        return scene.in_shares(torch.from_numpy(shares).to(scene.priors.device), columns)

    def judged(self, scene: Scene[Any], viewpoint: Any, random: np.random.Generator) -> Judged:
        """The picture to judge by, drawn so that each pixel is judged by a style as its share is.

        Args:
            scene: What is looked at.
            viewpoint: From where.
            random: What it is drawn from.
        """
        which, threshold = random.uniform(size=2)
        if not isinstance(self.share, np.ndarray):
            return Judged(self.second if threshold < self.share else self.first, None)
        seen = scene.seen_shares(torch.from_numpy(self.share).to(scene.priors), viewpoint)
        first, second = seen <= threshold, seen > threshold  # neither where nothing is seen
        of_second = float(second.sum()) / max(1.0, float((first | second).sum()))
        return Judged(self.second, second) if which < of_second else Judged(self.first, first)


class Lessons:
    """What is asked for in each rollout of each life; the same again for the same seed."""

    def __init__(self, count: int, domain: Domain, seed: int) -> None:
        """Prepare.

        Args:
            count: Of styles, at least 2.
            domain: The cells.
            seed: Of the random numbers.
        """
        self._count, self._seed = count, seed
        self._places = (domain.cells - np.asarray(domain.box.lower)) / domain.box.shape

    def of(self, life: int, age: int) -> Mix:
        """What is asked for in a rollout of a life, after `age` others."""
        random = np.random.default_rng((self._seed, life))
        begun, drawn = 0, self._drawn(random)
        for rollout in range(1, age + 1):
            if random.uniform() < CHANGED:
                begun, drawn = rollout, self._drawn(random)
        first, second, kind, share, wave = drawn
        if kind < 1 - EVEN - MASKED:
            return Mix(first, second, 0.0, age - begun)
        return Mix(first, second, share if kind < 1 - MASKED else self._mask(wave), age - begun)

    def _drawn(self, random: np.random.Generator) -> tuple[int, int, float, float, Sequence[float]]:
        """Two styles, of which kind the mix is, the share of the second, and the wave of a mask."""
        first, second = random.choice(self._count, 2, replace=False).tolist()
        kind, share, *wave = random.uniform(size=5).tolist()
        return first, second, kind, share, wave

    def _mask(self, wave: Sequence[float]) -> FloatArray:
        """`[n]`, a smooth wave across the box, from one of 26 sides, clamped to 0 and 1."""
        number = int(wave[0] * 26)
        along = OFFSETS[number + (number >= 13)]  # not (0, 0, 0)
        low, high = map(math.log, SHARPNESS)
        sharpness = np.exp(low + wave[1] * (high - low))
        height = np.cos(2 * np.pi * (self._places @ along + wave[2]))
        return np.clip(0.5 + sharpness * height, 0, 1).astype(np.float32)
