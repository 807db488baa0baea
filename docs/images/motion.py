"""Makes `motion.png`: what passes a vertical line through a jet, frame by frame.

    python docs/images/motion.py OUT PAINTED [PAINTED ...]

PAINTED is a folder that `vnca stylize` wrote. A panel each: time runs to the right, and up in the
smoke is up. Texture that is carried upwards leaves slanting streaks, texture that stays level ones.
"""

import sys
from pathlib import Path

import numpy as np

from vnca.io.picture import write_image
from vnca.recipe import SILENT
from vnca.recipe.film import FilmConfig
from vnca.recipe.rendering import RenderRun, strip
from vnca.recipe.sequence import open_sequence

SIZE = 384
FRAME = 16
"""Pixels that a frame is wide."""
ROWS = slice(180, 345)
"""Of the pictures: the jet, below the head of the plume."""
LINE = slice(186, 198)
"""Columns that the line is the mean of."""
GAP = 12


def main(out: str, *folders: str) -> None:
    """Write the panels side by side."""
    view = FilmConfig(rows=SIZE, columns=SIZE)
    panels = []
    for painted in folders:
        sequence = open_sequence(painted, None, SILENT)
        frames = strip(
            sequence, RenderRun(sequence=painted, out=Path(out), film=view), len(sequence)
        )
        passing = np.stack([frame[ROWS, LINE].mean(axis=1) for frame in frames], axis=1)
        panels += [np.repeat(passing, FRAME, axis=1), np.ones((len(passing), GAP, 3))]
    write_image(Path(out), np.concatenate(panels[:-1], axis=1).astype(np.float32))


if __name__ == "__main__":
    main(*sys.argv[1:])
