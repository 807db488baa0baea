"""How large the seam is where a chunk begins after a pre-roll, against whole paintings.

    python benchmarks/preroll.py SMOKE OUT.csv [--frames 30-53] [--styles NAME …] [OPTIONS OF SMOKE]

Paints a sequence with styles of the library, and some frames of it again after pre-rolls
of several lengths, each from nothing. Views of both are compared, as films show them. A row tells:

- `difference`: root mean square difference of the pre-rolled frame and the same of the whole;
- `change`: that of this frame and the one before, both of the whole painting;
- `across`: that of the pre-rolled frame and the one before in the whole: what is seen at the seam.

A seam of which `across / change` is 1 changes the picture as much as any other frame does.
"""

import argparse
import csv
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from vnca.core import FloatArray
from vnca.engine import Compute
from vnca.io import SmokeFormat
from vnca.painting import Painting, Roll, StylizeConfig
from vnca.recipe import SILENT
from vnca.recipe.film import Bounds, FilmConfig, Shown, behind, picture
from vnca.recipe.painting import Scales
from vnca.recipe.rendering import CELL_OPACITY
from vnca.recipe.sequence import (
    fullest_frame,
    open_sequence,
    region_bounds,
    sequence_region,
    volumes,
)
from vnca.rule.library import load_style

FIELDS = ("style", "preroll", "frame", "difference", "change", "across")
VIEW = FilmConfig(rows=256, columns=256)


def main() -> None:
    """Measure as asked, printing rows as they are found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("smoke")
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames")
    parser.add_argument("--styles", nargs="+", default=["stained_glass", "threads"])
    parser.add_argument("--prerolls", nargs="+", type=int, default=[2, 4, 8, 12, 16])
    parser.add_argument(
        "--chunks", nargs="+", type=int, help="first frames of chunks, from 0", default=[17]
    )
    parser.add_argument("--velocity-units", default="cells/frame")
    parser.add_argument("--time-scale", type=float, default=1.0)
    asked = parser.parse_args()
    smoke = SmokeFormat(velocity_units=asked.velocity_units, time_scale=asked.time_scale)
    with asked.out.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(FIELDS)
        for style in asked.styles:
            for row in measured(asked, style, smoke):
                told = [f"{value:.4g}" if isinstance(value, float) else value for value in row]
                table.writerow(told)
                file.flush()
                print(*told, flush=True)


def measured(asked: argparse.Namespace, style: str, smoke: SmokeFormat) -> Iterator[tuple]:
    """The rows of a style."""
    sequence = open_sequence(asked.smoke, asked.frames, SILENT)
    region = sequence_region(sequence, smoke, SILENT)
    scales = Scales.fitted(fullest_frame(sequence, smoke).path, smoke, CELL_OPACITY["painted"])
    rule = load_style(style).rule.rescaled(density=scales.density, gamma=scales.gamma)
    roll = Roll(rule, StylizeConfig(), region.box, Compute())
    bounds = region_bounds(region.box, region.lattice.to_world)
    last = max(asked.chunks)
    frames = list(islice(volumes(sequence, smoke, region.lattice), last + 1))
    views, state = [], roll.start()
    for frame in frames:
        painting = roll.paint(frame, state)
        state = painting.state
        views.append(_seen(roll, painting, bounds))
    for at in asked.chunks:
        for preroll in asked.prerolls:
            if preroll > at:
                continue
            state = roll.start()
            for frame in frames[at - preroll : at]:
                state = roll.passed(frame, state)
            view = _seen(roll, roll.paint(frames[at], state), bounds)
            yield (
                style,
                preroll,
                sequence[at].number,
                _rms(view - views[at]),
                _rms(views[at] - views[at - 1]),
                _rms(view - views[at - 1]),
            )


def _seen(roll: Roll, painting: Painting, bounds: Bounds) -> FloatArray:
    shown = Shown(
        replace(painting.smoke, density=painting.density),
        painting.colour,
        roll.rule.scales.extinction(painting.smoke.cell_length),
    )
    image = picture(shown, VIEW, bounds=bounds, turned=0.0).over(behind(VIEW))
    return np.clip(image, 0, 1) ** (1 / 2.2)


def _rms(difference: FloatArray) -> float:
    return float(np.sqrt(np.mean(difference**2)))


if __name__ == "__main__":
    main()
