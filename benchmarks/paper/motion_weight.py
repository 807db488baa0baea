"""The weight of motion against that of appearance: what one gains and the other loses.

Run `python benchmarks/paper/motion_weight.py --out DIR`; `--full` is as large as the paper. λ is
the weight of the motion loss relative to the median appearance loss of the latest iterations.

Reference: VNCA section 4.3, "Comparison on weights for loss functions".
"""

from dataclasses import dataclass, replace

from judge import Judge, paint
from study import Findings, Study, run

from vnca.metrics.motion import MotionMeasures, dis, measure_motion, ours


@dataclass(frozen=True)
class MotionWeight(Study):
    """On what the sweep is made, and over which weights."""

    weights: tuple[float, ...] = (0.0, 1.0, 4.0, 16.0)
    """λ of each kind."""


def sweep(study: MotionWeight) -> None:
    smoke, config, judge = study.volume, study.config, Judge(study)
    seen_by = {"network": ours(), "DIS": dis()}
    findings, pictures = Findings(study, "motion_weight"), {}
    for weight in study.weights:
        kind = f"lambda = {weight:g}"
        kind_config = replace(config, motion=replace(config.motion, weight=weight))
        for seed, rule in study.rules(f"motion_{weight:g}", kind_config):
            painting = paint(rule, smoke)
            moved = by_name(measure_motion(rule, smoke, seen_by))
            findings.add(kind, judge.around(painting, rule) | moved, seed=seed)
            if seed == study.seeds[0]:
                pictures[kind] = judge.sides(painting, rule)
    findings.tell()
    study.picture("motion_weight", judge.sheet(pictures))


def by_name(measures: MotionMeasures) -> dict[str, float]:
    """The measures of motion as columns of a table."""
    found = {}
    for estimator, direction in measures.direction.items():
        found[f"L_dir, {estimator}"] = direction
        found[f"L_mag, {estimator}"] = measures.magnitude[estimator]
    return {**found, "transport": measures.transport}


if __name__ == "__main__":
    run(MotionWeight, sweep, __doc__)
