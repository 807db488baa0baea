"""Whether pictures of painted smoke agree, from frame to frame and from side to side."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.ndimage import map_coordinates

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Camera
from vnca.core.colour import linear_to_srgb, luminance
from vnca.metrics.motion import Estimator
from vnca.metrics.setup import OPAQUE, Pair, Seen, Setup
from vnca.metrics.style import perceived

LONG = 7
"""Frames over which smoke is followed for the long warp error."""
FEWEST_PIXELS = 64
"""Pixels that must be seen in both pictures, or they are not compared."""
_SAME_DEPTH = 1.5  # cells between what two views see, if it is the same
_LEAST_CONTRAST = 1e-6
_BACKGROUND = 0.01


@dataclass(frozen=True)
class Agreement:
    """How far two pictures disagree on what both show: 0 if not at all, 1 as unrelated pixels.

    Attributes:
        painted: Of the painted smoke.
        plain: Of the smoke as it comes, which nothing painted can be expected to surpass by far.
    """

    painted: float
    plain: float

    @property
    def ratio(self) -> float | None:
        """Painted over plain, None where that is zero."""
        return self.painted / self.plain if self.plain else None


@dataclass(frozen=True)
class WarpError(Agreement):
    """How far a picture and a later one disagree, each pixel where its smoke has moved to.

    Attributes:
        unmoved: Of the painted smoke, each pixel where it was: as if it stood still.
    """

    unmoved: float


A = TypeVar("A", bound=Agreement)


def mean_agreement(agreements: Iterable[A | None]) -> A | None:
    """Over those there are; None if there are none."""
    known = [each for each in agreements if each is not None]
    if not known:
        return None
    return type(known[0])(*np.mean([astuple(each) for each in known], axis=0).tolist())


@dataclass(frozen=True)
class Step:
    """How a frame agrees with those before it.

    Attributes:
        frame: Its number.
        short: With the frame before, warped along the velocity of the smoke.
        long: With that `LONG` frames before.
        flow: Mean difference between the motion seen in the painting and in the smoke as it
            comes, since the frame before; pixels per frame.
    """

    frame: int
    short: WarpError | None
    long: WarpError | None
    flow: float | None


@dataclass(frozen=True, eq=False)
class _Shot:
    frame: int
    pair: Pair
    flow: FloatArray | None


class Coherence:
    """Compares the frames of a sequence, seen from one place, as they come.

    Reference: Lai et al. 2018 (warp error); Chu et al. 2020 (tOF).
    """

    def __init__(self, estimator: Estimator) -> None:
        """Prepare.

        Args:
            estimator: Sees motion in pictures, for the difference of flows.
        """
        self._estimator = estimator
        self._shots: deque[_Shot] = deque(maxlen=LONG + 1)
        self._steps: list[Step] = []

    def add(self, frame: int, pair: Pair, flow: FloatArray | None) -> None:
        """The next frame.

        Args:
            frame: Its number. One that does not follow the last begins anew.
            pair: What is seen of it.
            flow: How the smoke in it moves to the next, pixels to the right and down `[r, c, 2]`;
                None where that is not known.
        """
        if self._shots and self._shots[-1].frame + 1 != frame:
            self._shots.clear()
        self._shots.append(_Shot(frame, pair, flow))
        shots = list(self._shots)
        if len(shots) > 1:
            long = _warped(shots) if len(shots) == LONG + 1 else None
            self._steps.append(Step(frame, _warped(shots[-2:]), long, self._flow(*shots[-2:])))

    @property
    def steps(self) -> tuple[Step, ...]:
        """An entry for each frame that follows another."""
        return tuple(self._steps)

    @property
    def difference(self) -> FloatArray | None:
        """Where the last frame disagrees with the one before, `[r, c]` at the pixels of that one.

        Distance of the perceived colours; None without two frames, or without velocity.
        """
        if len(self._shots) < 2:
            return None
        before, after = list(self._shots)[-2:]
        moved = _followed([before, after])
        if moved is None:
            return None
        start, end = moved
        colours = _shown(before.pair.painted)[tuple(start.T)]
        picture = np.zeros(before.pair.where.shape, np.float32)
        change = colours - _sampled(_shown(after.pair.painted), end)
        picture[tuple(start.T)] = np.linalg.norm(change, axis=-1)
        return picture

    def _flow(self, before: _Shot, after: _Shot) -> float | None:
        where = before.pair.where & after.pair.where
        if where.sum() < FEWEST_PIXELS:
            return None
        painted, plain = (
            self._estimator(_grey(getattr(before.pair, kind)), _grey(getattr(after.pair, kind)))
            for kind in ("painted", "plain")
        )
        return float(np.linalg.norm(painted - plain, axis=-1)[where].mean())


def _warped(shots: Sequence[_Shot]) -> WarpError | None:
    """The first of some frames against the last."""
    moved = _followed(shots)
    if moved is None or len(moved[0]) < FEWEST_PIXELS:
        return None
    first, last = shots[0].pair, shots[-1].pair
    start, end = moved
    return WarpError(
        painted=_disagreement(first.painted, start, last.painted, end),
        plain=_disagreement(first.plain, start, last.plain, end),
        unmoved=_disagreement(first.painted, start, last.painted, start),
    )


def _followed(shots: Sequence[_Shot]) -> tuple[AnyArray, AnyArray] | None:
    """Pixels `[n, 2]` of the first frame, and where what they show has moved to in the last.

    Those that lie in smoke all the way; None where it is not known how they move.
    """
    first = shots[0].pair
    start = np.argwhere(first.where)
    at, seen = start.astype(np.float64), np.ones(len(start), bool)
    for before, after in pairwise(shots):
        if before.flow is None:
            return None
        at += _sampled(before.flow, at)[:, ::-1]
        seen &= _sampled(after.pair.where.astype(np.float32)[..., None], at)[:, 0] > 1 - 1e-4
    return start[seen], at[seen]


def around(setup: Setup, ring: Sequence[Pair]) -> Agreement | None:
    """How views agree with the next, the last with the first, on what both see.

    What a pixel shows lies at the mean depth of the smoke seen there. From the next view it is
    seen if the depth there is the same.

    Returns:
        The mean over the views, or None where neighbours see nothing in common.
    """
    turned = [*ring[1:], *ring[:1]]
    return mean_agreement(_reprojected(setup, *pair) for pair in zip(ring, turned, strict=True))


def _reprojected(setup: Setup, first: Pair, second: Pair) -> Agreement | None:
    start, size = np.argwhere(first.where), setup.size
    depth = first.painted.depth[tuple(start.T)]
    here, there = (setup.camera(pair.viewpoint) for pair in (first, second))
    points = _points(here, start, depth, size)
    row, column, expected = there.project(points, size, size)
    at = np.stack([row, column], axis=-1)
    opaque = _sampled((second.painted.opacity > OPAQUE).astype(np.float32)[..., None], at)[:, 0]
    known = np.where(np.isfinite(second.painted.depth), second.painted.depth, 0)
    off = np.abs(_sampled(known[..., None], at)[:, 0] - expected)
    seen = (opaque > 1 - 1e-4) & (off < _SAME_DEPTH)
    start, at = start[seen], at[seen]
    if len(start) < FEWEST_PIXELS:
        return None
    return Agreement(
        painted=_disagreement(first.painted, start, second.painted, at),
        plain=_disagreement(first.plain, start, second.plain, at),
    )


def _points(camera: Camera, pixels: AnyArray, depth: AnyArray, size: int) -> AnyArray:
    origins, directions = (rays[tuple(pixels.T)] for rays in camera.rays(size, size))
    return origins + depth[:, None] * directions


def _disagreement(one: Seen, pixels: AnyArray, other: Seen, places: AnyArray) -> float:
    return disagreement(_shown(one)[tuple(pixels.T)], _sampled(_shown(other), places))


def disagreement(before: AnyArray, after: AnyArray) -> float:
    """Root mean square difference of colours `[n, 3]`, over that of unrelated ones as varied."""
    contrast = before.var(0).sum() + after.var(0).sum()
    difference = np.square(before - after).mean(0).sum()
    return float(np.sqrt(difference / max(contrast, _LEAST_CONTRAST)))


def _shown(seen: Seen) -> AnyArray:
    """The colour of the smoke itself, as perceived."""
    return perceived(seen.colour / np.maximum(seen.opacity, OPAQUE / 2)[..., None])


def _grey(seen: Seen) -> FloatArray:
    return linear_to_srgb(luminance(seen.over([_BACKGROUND] * 3)).clip(0, 1)).astype(np.float32)


def _sampled(picture: AnyArray, places: AnyArray) -> AnyArray:
    """Values `[n, c]` between the pixels of a picture `[r, c, c]`; zero outside."""
    return np.stack(
        [
            map_coordinates(picture[..., channel], places.T, order=1, mode="constant")
            for channel in range(picture.shape[2])
        ],
        axis=-1,
    )
