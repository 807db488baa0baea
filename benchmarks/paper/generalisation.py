"""Trained on one frame, shown all: other frames, another scene, other resolutions.

Run `python benchmarks/paper/generalisation.py --out DIR`; `--full` is as large as the paper. A rule
trained on one frame paints the whole sequence, frame by frame as `vnca stylize` does, and from
nothing a simulated scene that it never met, and its own frame on coarser and finer grids. Each is
judged by views from all around; white smoke beside it says how much of the distance is the
smoke's own.

Reference: VNCA section 4.4.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from judge import PAINTED, UNPAINTED, Judge, magnified, paint
from study import REFERENCE, Findings, Lines, Study, run

from vnca.painting import Painting, stylize
from vnca.recipe import simulation
from vnca.recipe.sequence import open_sequence, sequence_region, volumes
from vnca.rule import Rule
from vnca.simulation import simulate

RESOLUTION = 48
"""Of simulated scenes: cells across."""
FRAMES, FIRST, TRAINED = 40, 10, 30
"""Of the simulated plume: how many there are, the first shown, the one trained on."""
LATE = 30
"""The frame of the other scene."""
FACTORS = (0.75, 1.5)
"""Cells of the other resolutions for a cell of the frame, in each direction."""
SHOWN = 5
"""Frames of the sequence on the sheet."""


@dataclass(frozen=True)
class Generalisation(Study):
    """On what a rule is trained, and what it paints then."""

    sequence: str | None = None
    """The sequence that --frame is of: a folder or a pattern, as `vnca stylize` takes. If it is not
    given, a plume is simulated and takes the place of both."""
    frames: str | None = None
    """Those of the sequence to paint, such as 30-53; all unless given."""


def generalise(study: Generalisation) -> None:
    if study.sequence is None:
        study = on_plume(study)
    judge, findings = Judge(study), Findings(study, "generalisation")
    pictures = {}
    for seed, rule in study.rules(REFERENCE, study.config):
        measures, preview_views = {}, {}
        for painting in painted(study, rule):
            name = f"frame {painting.smoke.frame}"
            measures[name] = judged(judge, painting, rule)
            preview_views[name] = judge.preview_view(painting, rule)
            findings.add("sequence", measures[name], seed=seed, on=name)
        findings.add("sequence", means([*measures.values()]), seed=seed, on="all frames")
        others = {"jets": last(simulate("jets", resolution=RESOLUTION, frames=LATE, seed=0))}
        others |= {f"grid x {factor:g}": magnified(study.volume, factor) for factor in FACTORS}
        paintings = {name: paint(rule, smoke) for name, smoke in others.items()}
        for name, painting in paintings.items():
            findings.add("unseen", judged(judge, painting, rule), seed=seed, on=name)
        if seed == study.seeds[0]:
            names = [*preview_views]
            chosen = np.linspace(0, len(names) - 1, SHOWN).round().astype(int)
            pictures["sequence"] = {names[at]: preview_views[names[at]] for at in chosen}
            pictures["unseen"] = {
                name: judge.preview_view(painting, rule) for name, painting in paintings.items()
            }
    findings.tell()
    study.picture("generalisation", judge.sheet(pictures))


def on_plume(study: Generalisation) -> Generalisation:
    """The same study of a simulated plume."""
    folder = study.out / "smoke"
    for _ in simulation.simulate("plume", out=folder, resolution=RESOLUTION, frames=FRAMES, seed=0):
        pass
    return replace(
        study,
        frame=folder / f"plume_{TRAINED:04d}.vdb",
        sequence=str(folder),
        frames=f"{FIRST}-{FRAMES}",
    )


def painted(study: Generalisation, rule: Rule) -> Iterator[Painting]:
    """The sequence as the rule paints it."""
    sequence = open_sequence(str(study.sequence), study.frames, Lines())
    lattice, box = sequence_region(sequence, study.smoke, Lines())
    frames = volumes(sequence, study.smoke, lattice)
    return stylize(frames, rule, PAINTED, box=box)


def judged(judge: Judge, painting: Painting, rule: Rule) -> dict[str, float]:
    """How far a painting is from the picture, and how far its smoke is when it is white."""
    white = judge.around(paint(rule, painting.smoke, UNPAINTED), rule)
    return {**judge.around(painting, rule), "L_app of white smoke": white["L_app"]}


def means(found: list[dict[str, float]]) -> dict[str, float]:
    return {name: float(np.mean([measures[name] for measures in found])) for name in found[0]}


T = TypeVar("T")


def last(values: Iterable[T]) -> T:
    *_, value = values
    return value


if __name__ == "__main__":
    run(Generalisation, generalise, __doc__)
