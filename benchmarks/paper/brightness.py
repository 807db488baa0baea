"""Brightness by γ, without training again.

Run `python benchmarks/paper/brightness.py --out DIR`; `--full` is as large as the paper. The
reference paints the frame once; it is looked at with several multiples of the γ it was trained
with, by emission and absorption and by the paper's integrand. Luminance is the mean over the
pixels that the smoke covers, in front of black.

Reference: VNCA section 4.1, "By changing the transmittance of the density field, …".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import get_args

import torch
from judge import AROUND, Judge, paint
from study import REFERENCE, Findings, Study, run
from torch import Tensor

from vnca.painting import Painting
from vnca.rendering.colour import luminance
from vnca.rendering.view import Mode
from vnca.rule import Rule


@dataclass(frozen=True)
class Brightness(Study):
    """On what the study is made, and with which multiples of γ."""

    gammas: tuple[float, ...] = (1 / 64, 1 / 16, 1 / 4, 1.0, 4.0)
    """What the γ of training is multiplied by."""


def vary(study: Brightness) -> None:
    smoke, judge = study.volume, Judge(study)
    findings, pictures = Findings(study, "brightness"), {}
    for seed, rule in study.rules(REFERENCE, study.config):
        painting = paint(rule, smoke)
        for mode in get_args(Mode):
            for gamma in study.gammas:
                measures = seen(judge, painting, rule, gamma, mode)
                findings.add(f"{mode}, {times(gamma)}", measures, seed=seed)
            if seed == study.seeds[0]:
                pictures[mode] = {
                    times(gamma): judge.preview_view(painting, rule, gamma=gamma, mode=mode)
                    for gamma in study.gammas
                }
    findings.tell()
    study.picture("brightness", judge.sheet(pictures))


def times(gamma: float) -> str:
    return f"gamma x {Fraction(gamma).limit_denominator(1000)}"


def seen(
    judge: Judge, painting: Painting, rule: Rule, gamma: float, mode: Mode
) -> dict[str, float]:
    """How bright and opaque a painting is from all around, and how far from the picture."""
    views = [judge.look(painting, rule, viewpoint, gamma=gamma, mode=mode) for viewpoint in AROUND]
    covered = [
        judge.look(painting, rule, viewpoint, mode="emission-absorption").opacity > 0.5
        for viewpoint in AROUND
    ]

    def mean(values: Sequence[Tensor]) -> float:
        chosen = [value[where] for value, where in zip(values, covered, strict=True)]
        return float(torch.cat(chosen).mean())

    return {
        "luminance": mean([luminance(view.colour.clamp(0, 1)) for view in views]),
        "opacity": mean([view.opacity for view in views]),
        **judge.distance(views),
    }


if __name__ == "__main__":
    run(Brightness, vary, __doc__)
