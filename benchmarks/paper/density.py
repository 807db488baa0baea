"""Density encoding on and off: how near the painting comes to the picture.

Run `python benchmarks/paper/density.py --out DIR`; `--full` is as large as the paper. A rule
without density encoding is trained and painted like the reference, but its cells see zero where
the others see the density. Judged by views from all around, none of them drawn by training.

Reference: VNCA section 4.3, "Density encoding".
"""

from dataclasses import dataclass, replace

from judge import UNPAINTED, Judge, paint
from study import REFERENCE, Findings, Study, run

from vnca.engine.domain import DomainKind
from vnca.training.config import SmokeConfig

DOMAINS = {"active": "smoke", "box": "its box"}


@dataclass(frozen=True)
class Density(Study):
    """On what the study is made."""

    domain: DomainKind | None = None
    """Which cells are active: those near the smoke (active), whose surface tells them where it is,
    or in all of its box as in the paper; as the preset has it unless given."""
    velocity: bool = True
    """Whether cells are told the velocity, by which they can tell where smoke is, too."""
    position: bool = False
    """Tell cells their place in the box, as the preset of --full does anyway."""

    @property
    def config(self) -> SmokeConfig:
        """That of the reference."""
        config = super().config
        rule = replace(
            config.rule,
            domain=self.domain or config.rule.domain,
            velocity_prior=self.velocity,
            position_prior=self.position or config.rule.position_prior,
        )
        return replace(config, rule=rule)


def compare(study: Density) -> None:
    smoke, config, judge = study.volume, study.config, Judge(study)
    rule_config = replace(config.rule, density_prior=False)
    kinds = {"with": config, "without": replace(config, rule=rule_config)}
    where, name = f"cells in {DOMAINS[config.rule.domain]}", f"density_{config.rule.domain}"
    if config.rule.position_prior:
        where, name = f"{where}, told their place", f"{name}_with_position"
    if not study.velocity:
        where, name = f"{where}, told no velocity", f"{name}_without_velocity"
    findings, pictures = Findings(study, "density"), {}
    reference = study.trained(REFERENCE, config, study.seeds[0])
    white = paint(reference, smoke, UNPAINTED)
    findings.add("white smoke", judge.around(white, reference), on=where)
    for kind, kind_config in kinds.items():
        for seed, rule in study.rules(f"{kind}_density", kind_config):
            painting = paint(rule, smoke)
            findings.add(
                f"{kind} density encoding", judge.around(painting, rule), seed=seed, on=where
            )
            if seed == study.seeds[0]:
                pictures[f"{kind} density"] = judge.sides(painting, rule)
    findings.tell()
    study.picture(name, judge.sheet(pictures))


if __name__ == "__main__":
    run(Density, compare, __doc__)
