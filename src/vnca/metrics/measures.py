"""What was found, as measures with a name, a value and what it means."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from vnca.metrics import Survey, TextureMotion
from vnca.metrics.coherence import LONG, Agreement, mean_agreement
from vnca.metrics.style_score import joined_style_score

_Better = Literal["higher", "lower", "nearer to 0"]
_NORMALISED = "normalised: 0 plain smoke, 1 the picture's own parts"
_STRUCTURE: tuple[tuple[str, str, str, str, _Better], ...] = (
    (
        "structure.lines",
        "Lines",
        "How much more (or less) it is made of lines than the picture is.",
        "difference of agreement of directions, from -1 to 1",
        "nearer to 0",
    ),
    (
        "structure.width",
        "Width of strokes",
        "How much wider (or narrower) its strokes are than the picture's.",
        "octaves",
        "nearer to 0",
    ),
    (
        "structure.contrast",
        "Bright on dark",
        "How much more (or less) its marks are bright on dark than the picture's.",
        "difference of shares, from -2 to 2",
        "nearer to 0",
    ),
    (
        "structure.direction",
        "Direction of strokes",
        "The share of its strokes that run another way than the picture's.",
        "share",
        "lower",
    ),
    (
        "structure.regions",
        "Colours by region",
        "How much of the way from grey smoke to the picture it goes in large shapes: by the "
        "colours of regions, an eighth of the picture wide.",
        _NORMALISED,
        "higher",
    ),
    (
        "structure.patches",
        "Patches",
        "The same by patches of 7×7 pixels, each with the nearest one of the other.",
        _NORMALISED,
        "higher",
    ),
)
_PART = {
    True: "which the rule was trained to please: it says less than the others",
    False: "which had no part in training",
    None: "which may have had a part in training",
}


@dataclass(frozen=True)
class Measure:
    """One measure.

    Attributes:
        name: As in JSON.
        title: As in a report.
        meaning: A sentence that says what it is.
        value: None where it could not be measured.
        unit: Of the value, in words.
        better: Which values are; None for a matter of taste.
        unstylized: What it is for the smoke as it comes, where that has one.
        more: Further values.
        reason: Why there is no value.
    """

    name: str
    title: str
    meaning: str
    value: float | None
    unit: str
    better: _Better | None
    unstylized: float | None = None
    more: Mapping[str, Any] = field(default_factory=dict)
    reason: str = ""

    def as_json(self) -> dict[str, Any]:
        """An object with all of it that a program may want."""
        described = {"value": self.value, "unit": self.unit, "better": self.better}
        if self.unstylized is not None:
            described["unstylized"] = self.unstylized
        if self.value is None:
            described["reason"] = self.reason
        return described | dict(self.more)


def measures(survey: Survey, *, regions_compared: bool = False) -> tuple[Measure, ...]:
    """All measures of a survey.

    Args:
        survey: What was found.
        regions_compared: Whether the training compared colours of regions, too.
    """
    return (
        *_style(survey),
        *_structure(survey, regions_compared),
        *_views(survey),
        *_time(survey),
        *_motion(survey.turn.texture),
        *_density(survey),
    )


def _style(survey: Survey) -> Iterable[Measure]:
    style = joined_style_score(survey.style.values())
    yield Measure(
        "style.score",
        "Normalised style score",
        "How much of the way from grey smoke to the picture the painting goes: 1 is as near as "
        "the picture's own parts are.",
        style.normalised_score,
        _NORMALISED,
        "higher",
        unstylized=0.0,
        more={
            **style.by_measure,
            "frames": {
                frame: style_score.normalised_score for frame, style_score in survey.style.items()
            },
        },
    )
    for judge in survey.judges:
        known = [*judge.shares.values()]
        yield Measure(
            f"style.by_{judge.name}",
            f"Normalised style score, by {judge.name}",
            f"The same in the eyes of the network '{judge.name}', {_PART[judge.trained_with]}.",
            float(np.mean(known)) if known else None,
            _NORMALISED,
            "higher",
            unstylized=0.0,
            more={"trained_with": judge.trained_with, "frames": judge.shares},
            reason=judge.reason or "the smoke is opaque in no frame that was looked at",
        )


def _structure(survey: Survey, regions_compared: bool) -> Iterable[Measure]:
    for name, title, meaning, unit, better in _STRUCTURE:
        of = name.partition(".")[2]
        trained_with = regions_compared and of == "regions"
        if trained_with:
            meaning += " Training compared regions, too: it says less than the others."
        values = {frame: getattr(found, of) for frame, found in survey.structure.items() if found}
        known = [value for value in values.values() if value is not None]
        yield Measure(
            name,
            title,
            meaning,
            float(np.mean(known)) if known else None,
            unit,
            better,
            more={"trained_with": trained_with, "frames": values},
            reason="in the frames that were looked at, too little that is opaque, or nothing in "
            "it, is large enough to tell",
        )


def _views(survey: Survey) -> Iterable[Measure]:
    turn = survey.turn
    yield Measure(
        "views.spread",
        "Spread over views",
        "How much the normalised style score varies from side to side, above and below.",
        turn.style_score.spread,
        "standard deviation over mean",
        "lower",
        more={
            "frame": turn.frame,
            "mean": turn.style_score.normalised_score,
            "views": [
                {
                    "azimuth": viewpoint.azimuth,
                    "elevation": viewpoint.elevation,
                    "score": share,
                }
                for viewpoint, share in zip(
                    turn.style_score.viewpoints, turn.style_score.shares, strict=True
                )
            ],
        },
    )
    yield _agreement(
        "views.reprojection",
        "Neighbouring views",
        "How far two views 15° apart disagree on what both of them show.",
        turn.around,
        "no two views show the same smoke",
    )


def _time(survey: Survey) -> Iterable[Measure]:
    for name, title, later, frames, found in (
        ("short", "Warp error, short", "the next", 1, [step.short for step in survey.steps]),
        (
            "long",
            "Warp error, long",
            f"{LONG} frames on",
            LONG,
            [step.long for step in survey.steps],
        ),
    ):
        error = mean_agreement(found)
        yield _agreement(
            f"time.warp_{name}",
            title,
            f"How far a picture and {later} disagree, each pixel followed along the smoke's "
            "velocity.",
            error,
            _why_not(survey, frames),
            **({"unmoved": error.unmoved} if error else {}),
        )
    flows = [step.flow for step in survey.steps if step.flow is not None]
    yield Measure(
        "time.flow",
        "Difference of flows (tOF)",
        "How far the motion seen in the painting is from that seen in grey smoke.",
        float(np.mean(flows)) if flows else None,
        "pixels per frame",
        "lower",
        unstylized=0.0,
        reason=_why_not(survey, 1),
    )


def _why_not(survey: Survey, frames: int) -> str:
    if len(survey.steps) < frames:
        return f"it takes {frames + 1} frames in a row"
    return "the frames have no velocity, or too little smoke in them"


def _agreement(
    name: str, title: str, meaning: str, found: Agreement | None, reason: str, **more: float
) -> Measure:
    return Measure(
        name,
        title,
        meaning,
        found.painted if found else None,
        "difference over that of unrelated pixels",
        "lower",
        unstylized=found.plain if found else None,
        more={"ratio": found.ratio, **more} if found else {},
        reason=reason,
    )


def _motion(texture: TextureMotion | str) -> Iterable[Measure]:
    known = texture if isinstance(texture, TextureMotion) else None
    reason = texture if isinstance(texture, str) else ""
    for at, (name, title, meaning, unit) in enumerate(
        (
            (
                "direction",
                "Direction of motion (L_dir)",
                "How far the texture moves another way than the smoke, held still: 0 the same way, "
                "1 across, 2 against it.",
                "cosine distance",
            ),
            (
                "magnitude",
                "Speed of motion (L_mag)",
                "How much faster or slower than the smoke its texture moves.",
                "pixels per frame",
            ),
        )
    ):
        more = {}
        if known:
            more = {
                **getattr(known.rule, name),
                "advected_noise": getattr(known.carried, name)["dis"],
                "rigid_drift": known.drift[at],
            }
        value = more.get("dis")
        yield Measure(
            f"motion.{name}", title, meaning, value, unit, "lower", more=more, reason=reason
        )
    yield Measure(
        "motion.transport",
        "Transport ratio",
        "How much of what changes in the cells is not advected: 0 if all is, 1 or more if none is.",
        known.rule.transport if known else None,
        "share of the change",
        "lower",
        more={"advected_noise": known.carried.transport, "speed": known.rule.speed}
        if known
        else {},
        reason=reason,
    )


def _density(survey: Survey) -> Iterable[Measure]:
    changes = survey.density
    moved = _by_frame(survey.frames, [change.moved for change in changes])
    mass = _by_frame(survey.frames, [change.mass_change for change in changes])
    yield Measure(
        "density.mass_change",
        "Change of mass",
        "How much smoke there is more (or less) than in the input.",
        float(np.mean([*mass.values()])),
        "share of the mass",
        "nearer to 0",
        unstylized=0.0,
        more={"frames": mass},
    )
    yield Measure(
        "density.moved",
        "Smoke moved",
        "How much of the smoke is taken away here or added there, to paint with density.",
        float(np.mean([*moved.values()])),
        "share of the mass",
        None,
        unstylized=0.0,
        more={"frames": moved},
    )


def _by_frame(frames: Sequence[int], values: Sequence[float]) -> dict[int, float]:
    return dict(zip(frames, values, strict=True))
