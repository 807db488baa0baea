"""The methods of the paper's comparison on its scene, smaller: seconds, memory, and looks.

Run `python benchmarks/paper/methods.py --out DIR`. The paper's *Smoke Jet* is simulated with
`--resolution` cells across in the place of 200, and 20 consecutive frames from the 70th on are
painted by every method (`vnca compare`, which goes on where it was interrupted). The picture is
grey for all, as in the paper. The other methods are ours, after their papers: see
docs/guide/peers.md.

Reference: VNCA section 4.2 and its table "Quantitative Comparison with TNST and LNST".
"""

from dataclasses import dataclass

from study import Findings, Lines, Study, run

from vnca.comparison import CompareRun
from vnca.comparison import compare as comparison
from vnca.comparison.report import as_json
from vnca.core.errors import OptionError
from vnca.io import SmokeFormat
from vnca.recipe import simulation

FIRST = 70
"""The first frame that is painted, of the paper's 120."""


@dataclass(frozen=True)
class Methods(Study):
    """Which methods, and on how large a scene."""

    methods: tuple[str, ...] = ("vnca", "aurand", "lnst", "tnst")
    """As `vnca compare --methods` has it."""
    resolution: int = 32
    """Cells across the scene; the paper has 200."""
    count: int = 20
    """Frames painted."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.count <= 51:
            raise OptionError(f"--count {self.count}: must be from 1 to 51 frames")


def compare(study: Methods) -> None:
    last = FIRST + study.count - 1
    folder = study.out / f"jet_{study.resolution}"
    if not (folder / f"jet_{last:04d}.vdb").exists():
        for _ in simulation.simulate(
            "jet", out=folder, preset="paper", resolution=study.resolution, frames=last
        ):
            pass
    findings = Findings(study, "methods")
    grid = f"{study.resolution}×{3 * study.resolution // 2}×{study.resolution}"
    for seed in study.seeds:
        asked = CompareRun(
            sequence=str(folder),
            picture=study.style,
            out=study.out / f"compared_{study.resolution}_{seed}",
            methods=study.methods,
            frames=f"{FIRST}-{last}",
            features=study.features,
            seed=seed,
            smoke=SmokeFormat(),
        )
        for name, measures in as_json(comparison.run(asked, Lines())).items():
            known = {title: value for title, value in measures.items() if value is not None}
            findings.add(name, known, seed=seed, on=grid)
    findings.tell()


if __name__ == "__main__":
    run(Methods, compare, __doc__)
