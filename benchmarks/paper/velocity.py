"""Velocity encoding on and off: how near the motion of the texture comes to the smoke's.

Run `python benchmarks/paper/velocity.py --out DIR`; `--full` is as large as the paper. Both rules
are trained with motion supervision; of one the cells see zero where the others see the velocity.
Motion is measured on smoke that is held still. `--scene jets` simulates two jets that collide:
where all smoke moves one way, a drift does nearly as well as a rule that knows the velocity.

Reference: VNCA section 4.3, "Velocity encoding", and its table of ablations.
"""

from dataclasses import dataclass, replace
from typing import Literal

from judge import Judge, paint
from motion_weight import by_name
from study import Findings, Study, run

from vnca.metrics.motion import dis, measure_motion, ours
from vnca.recipe import simulation

RESOLUTION, FRAME = 48, 25
"""Of the jets: cells across, and the frame that is trained on."""


@dataclass(frozen=True)
class Velocity(Study):
    """On what the study is made."""

    scene: Literal["frame", "jets"] = "frame"
    """The smoke of --frame, or two simulated jets in its place."""


def compare(study: Velocity) -> None:
    if study.scene == "jets":
        study = on_jets(study)
    smoke, config, judge = study.volume, study.config, Judge(study)
    seen_by = {"network": ours(), "DIS": dis()}
    without = replace(config, rule=replace(config.rule, velocity_prior=False))
    findings, pictures = Findings(study, "velocity"), {}
    for kind, kind_config in {"with": config, "without": without}.items():
        for seed, rule in study.rules(f"{kind}_velocity", kind_config):
            painting = paint(rule, smoke)
            moved = by_name(measure_motion(rule, smoke, seen_by))
            findings.add(
                f"{kind} velocity encoding",
                judge.around(painting, rule) | moved,
                seed=seed,
                on=study.scene,
            )
            if seed == study.seeds[0]:
                pictures[f"{kind} velocity"] = judge.sides(painting, rule)
    findings.tell()
    study.picture(f"velocity_{study.scene}", judge.sheet(pictures))


def on_jets(study: Velocity) -> Velocity:
    """The same study of two jets that collide."""
    folder = study.out / "jets"
    for _ in simulation.simulate("jets", out=folder, resolution=RESOLUTION, frames=FRAME, seed=0):
        pass
    return replace(study, frame=folder / f"jets_{FRAME:04d}.vdb")


if __name__ == "__main__":
    run(Velocity, compare, __doc__)
