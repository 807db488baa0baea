"""All measures of a painted sequence, in one pass over its frames."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vnca.core import FloatArray
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.metrics.coherence import Agreement, Coherence, Step, around
from vnca.metrics.motion import (
    Estimator,
    MotionMeasures,
    estimators,
    measure_carried_noise,
    measure_drift,
    measure_motion,
)
from vnca.metrics.setup import Coloured, Pair, Setup, Viewpoint
from vnca.metrics.structure import Likeness, StructureMetric
from vnca.metrics.style import StyleMetric
from vnca.metrics.style_score import SIDES, Judge, StyleScore, joined_style_score, score_style
from vnca.painting import Painting
from vnca.rule import Rule

RING = tuple(Viewpoint(15.0 * turn, 10.0) for turn in range(24))
"""Views all around the smoke."""
POLES = tuple(
    Viewpoint(azimuth, elevation)
    for elevation in (60.0, -60.0)
    for azimuth in (0.0, 90.0, 180.0, 270.0)
)
"""Views from above and below."""
FILM = Viewpoint(0.0, 10.0)
"""From where the frames are compared with each other."""
STYLE_FRAMES = 5
"""Frames that are compared with the picture."""
STRIP_FRAMES = 8
"""Frames of which pictures are kept."""
MOTION_SIZE = 128
"""Rows and columns of the pictures in which motion is looked for."""


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


@dataclass(frozen=True, eq=False)
class Still:
    """A frame of the film.

    Attributes:
        frame: Its number.
        pair: What is seen of it.
        difference: Where it disagrees with the frame before, `[r, c]`; see `Coherence`.
    """

    frame: int
    pair: Pair
    difference: FloatArray | None


@dataclass(frozen=True)
class TextureMotion:
    """How the texture of the rule moves on one frame that is held still.

    Attributes:
        rule: What was measured.
        carried: The same of noise that the velocity carries: what can be measured at best.
        drift: L_dir and L_mag of a texture that moves as one.
    """

    rule: MotionMeasures
    carried: MotionMeasures
    drift: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Turn:
    """One frame, looked at from all sides.

    Attributes:
        frame: Its number.
        ring: Its views all around, and from above and below.
        style_score: How much they look like the picture.
        around: How the views all around agree with their neighbours.
        texture: How the texture moves, or why that is not known.
    """

    frame: int
    ring: tuple[Pair, ...]
    style_score: StyleScore
    around: Agreement | None
    texture: TextureMotion | str


@dataclass(frozen=True, eq=False)
class Survey:
    """What was found.

    Attributes:
        frames: Numbers of the frames painted.
        style: The style_score of four sides of some frames, by frame; at least of one.
        judges: What networks say of the same.
        structure: How the structure of the same differs, by frame; perhaps of none.
        turn: The middle frame.
        steps: How each frame agrees with those before.
        density: How each frame's density changes.
        strip: Some frames of the film.
    """

    frames: tuple[int, ...]
    style: dict[int, StyleScore]
    judges: tuple[Judge, ...]
    structure: dict[int, Likeness | None]
    turn: Turn
    steps: tuple[Step, ...]
    density: tuple[DensityChange, ...]
    strip: tuple[Still, ...]


def survey(
    paintings: Iterable[Painting],
    count: int,
    rule: Rule,
    setup: Setup,
    metric: StyleMetric,
    judges: Sequence[Judge] = (),
) -> Survey:
    """Measure a sequence while it is painted; no more than a few frames are kept at a time.

    Args:
        paintings: Its frames in order.
        count: How many there are, one at least.
        rule: What paints them, for cells as fine as its automaton's.
        setup: How they are looked at.
        metric: What they are compared with.
        judges: Networks that compare them with it, too.

    Raises:
        GridError: If the smoke of the middle frame is opaque nowhere.
        BackendUnavailableError: If OpenCV is not installed.
    """
    seen_by = estimators()
    coherence = Coherence(seen_by["dis"])
    by_structure = StructureMetric(metric)
    frames, density, strip, style, structure, turn = [], [], [], {}, {}, None
    kept, compared = _spread(count, STRIP_FRAMES), _spread(count, STYLE_FRAMES)
    for at, painting in enumerate(paintings):
        smoke = painting.smoke
        painted, plain = Coloured.painted(painting), Coloured.plain(smoke)
        frames.append(smoke.frame)
        density.append(DensityChange.of(painting))
        film = setup.look_twice(painted, plain, FILM)
        coherence.add(smoke.frame, film, setup.motion(smoke, FILM))
        if at in kept:
            strip.append(Still(smoke.frame, film, coherence.difference))
        if at in compared:
            pairs = [setup.look_twice(painted, plain, viewpoint) for viewpoint in SIDES]
            if (found := score_style(metric, pairs)) is not None:
                style[smoke.frame] = found
                structure[smoke.frame] = by_structure.likeness(pairs)
                for judge in judges:
                    judge.look(smoke.frame, pairs, metric)
        if at == count // 2:
            ring = tuple(
                setup.look_twice(painted, plain, viewpoint) for viewpoint in (*RING, *POLES)
            )
            turn = Turn(
                smoke.frame,
                ring,
                joined_style_score([score_style(metric, ring)]),
                around(setup, ring[: len(RING)]),
                _texture(rule, painting.coarse or smoke, seen_by),
            )
    assert turn is not None, "there are fewer paintings than was said"
    return Survey(
        tuple(frames),
        style or {turn.frame: turn.style_score},
        tuple(judges),
        structure,
        turn,
        coherence.steps,
        tuple(density),
        tuple(strip),
    )


def _texture(rule: Rule, smoke: Volume, seen_by: Mapping[str, Estimator]) -> TextureMotion | str:
    try:
        return TextureMotion(
            measure_motion(rule, smoke, seen_by, size=MOTION_SIZE),
            measure_carried_noise(rule, smoke, seen_by, size=MOTION_SIZE),
            measure_drift(rule, smoke, size=MOTION_SIZE),
        )
    except GridError as error:  # without velocity, or at rest
        return str(error)


def _spread(count: int, wanted: int) -> set[int]:
    """Up to so many places of `count`, evenly spread, the last among them."""
    return set(np.linspace(0, count - 1, min(count, wanted) + 1)[1:].round().astype(int).tolist())
