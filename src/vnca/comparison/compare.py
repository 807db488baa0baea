"""From smoke and a picture to a report on every method."""

import json
from pathlib import Path

import numpy as np

import vnca
from vnca.bench import run_facts
from vnca.comparison import PICTURE, CompareRun, contenders
from vnca.comparison.measure import Result, bench, measure
from vnca.comparison.report import as_json, report, write_films
from vnca.comparison.study import page
from vnca.core.files import whole_file, writable_folder
from vnca.io import with_fitted_scale
from vnca.io.picture import read_image
from vnca.io.sequence import format_frames
from vnca.peers.gram import grey_picture
from vnca.recipe import Watch, tracked
from vnca.recipe.sequence import open_sequence, sequence_region, volumes

REPORT = "report.html"
MEASURES = "report.json"
STUDY = "study.html"
FPS = 12.0
"""Frames a second of the films: half speed, to see what flickers."""


def run(options: CompareRun, watch: Watch) -> list[Result]:
    """Paint with every method, measure all, and write the report, the films and perhaps a study.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    out = writable_folder(options.out)
    sequence = open_sequence(options.sequence, options.frames, watch)
    smoke = with_fitted_scale(options.smoke, sequence)
    region = sequence_region(sequence, smoke, watch)
    found = contenders(options, sequence, watch)
    given = list(volumes(sequence, smoke, region.lattice))
    picture = read_image(out / PICTURE)
    judged = bench(given, region, picture, smoke, options.size, watch)
    results = [
        measure(contender, given, sequence, judged)
        for contender in tracked(found, watch, "measuring", len(found), "methods")
    ]
    films = write_films(results, out, FPS)
    grey = grey_picture(picture)
    numbers = [frame.number for frame in sequence]
    facts = {
        "title": f"{Path(options.picture).stem} on {sequence[0].path.resolve().parent.name}",
        "frames": f"{format_frames(numbers)} of {sequence[0].path.name} …, "
        f"{' × '.join(str(n) for n in region.box.shape)} cells",
        "measured": f"by vnca {vnca.__version__}, {run_facts('cpu', 1)['date']} UTC, at "
        f"{options.size}×{options.size} pixels",
    }
    _write(out / REPORT, report(results, grey, films, facts))
    _write(out / MEASURES, json.dumps(as_json(results), indent=2) + "\n")
    watch.made("report", out / REPORT)
    watch.made("film", films[-1])
    if options.study:
        names = [result.contender.name for result in results]
        stills = [np.asarray(result.film[len(result.film) // 2]) for result in results]
        _write(out / STUDY, page(names, films, stills, grey, seed=options.seed))
        watch.made("study", out / STUDY)
    return results


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
