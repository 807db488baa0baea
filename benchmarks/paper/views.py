"""A single training view against random views, seen from the front, the right, the back and above.

Run `python benchmarks/paper/views.py --out DIR`; `--full` is as large as the paper. One rule is
trained from the front alone, the other from anywhere around the smoke; each view of both is judged
apart, and so are views from all around.

Reference: VNCA section 4.3, "Multi-view Style Consistency".
"""

from dataclasses import replace

from judge import SIDES, Judge, paint
from study import Findings, Study, run


def compare(study: Study) -> None:
    smoke, config, judge = study.volume, study.config, Judge(study)
    azimuth, elevation = SIDES["front"]
    front = replace(config.view, azimuths=(azimuth,), elevation=elevation)
    kinds = {"random views": config, "the front alone": replace(config, view=front)}
    findings, pictures = Findings(study, "views"), {}
    for kind, kind_config in kinds.items():
        for seed, rule in study.rules(kind.replace(" ", "_"), kind_config):
            painting = paint(rule, smoke)
            for side, viewpoint in SIDES.items():
                seen = judge.distance([judge.look(painting, rule, viewpoint)])
                findings.add(kind, seen, seed=seed, on=side)
            findings.add(kind, judge.around(painting, rule), seed=seed, on="around")
            if seed == study.seeds[0]:
                pictures[kind] = judge.sides(painting, rule)
    findings.tell()
    study.picture("views", judge.sheet(pictures))


if __name__ == "__main__":
    run(Study, compare, __doc__)
