"""Density encoding on and off: how near the painting comes to the picture.

Run `python benchmarks/paper/density.py --out DIR`; `--full` is as large as the paper. A rule
without density encoding is trained and painted like the reference, but its cells see zero where
the others see the density. Judged by views from all around, none of them drawn by training.

Reference: VNCA section 4.3, "Density encoding".
"""

from dataclasses import replace

from judge import SIDES, UNPAINTED, Judge, paint
from study import REFERENCE, Findings, Study, run


def compare(study: Study) -> None:
    smoke, config, judge = study.volume, study.config, Judge(study)
    rule_config = replace(config.rule, density_prior=False)
    kinds = {"with": config, "without": replace(config, rule=rule_config)}
    findings, pictures = Findings(study, "density"), {}
    reference = study.trained(REFERENCE, config, study.seeds[0])
    white = paint(reference, smoke, UNPAINTED)
    findings.add("white smoke", judge.around(white, reference))
    for kind, kind_config in kinds.items():
        for seed, rule in study.rules(f"{kind}_density", kind_config):
            painting = paint(rule, smoke)
            findings.add(f"{kind} density encoding", judge.around(painting, rule), seed=seed)
            if seed == study.seeds[0]:
                pictures[f"{kind} density encoding"] = [
                    judge.portrait(painting, rule, sight) for sight in SIDES.values()
                ]
    findings.tell()
    study.picture("density", judge.sheet(pictures))


if __name__ == "__main__":
    run(Study, compare, __doc__)
