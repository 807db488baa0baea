"""A sheet of what rules make of their pictures: each picture, and smoke painted from four sides.

    python benchmarks/styles/sheet.py SMOKE OUT.png [OPTIONS] PICTURE=RUN[=RUN …] [PICTURE=RUN …]

Paints the last of some frames with the model of each RUN and films it as `vnca render` does, lit,
from the front, the right, behind and above, at 512 pixels each; runs of a picture stand beside each
other.
"""

import numpy as np
from measure import read_as, runs_parser

import vnca
from vnca.core import AnyArray
from vnca.io.picture import fit, read_image
from vnca.recipe.film import FilmConfig, behind
from vnca.recipe.film import picture as film_picture
from vnca.recipe.sequence import region_bounds

SIZE = 512
SIDES = ((0.0, 10.0), (90.0, 10.0), (180.0, 10.0), (0.0, 60.0))
"""Azimuth and elevation, degrees."""


def main() -> None:
    """Write it, a row at a time."""
    asked = runs_parser(__doc__, frames="42-45", refine=2).parse_args()
    rows = []
    for pair in asked.runs:
        picture, *runs = pair.split("=")
        rows.append([_squared(read_image(picture))])
        for run in runs:
            *_, last = vnca.stylize(
                run, asked.smoke, frames=asked.frames, refine=asked.refine, **read_as(asked)
            )
            rows[-1] += [seen(last, *side) for side in SIDES]
        vnca.write_image(asked.out, np.concatenate([np.concatenate(row, axis=1) for row in rows]))
        print(picture, flush=True)


def seen(frame: vnca.PaintedFrame, azimuth: float, elevation: float) -> AnyArray:
    """A picture of a painted frame, linear RGB `[r, c, 3]`."""
    smoke = frame.shown.smoke
    film = FilmConfig(rows=SIZE, columns=SIZE, elevation=elevation)
    bounds = region_bounds(smoke.box, smoke.index_to_world)
    view = film_picture(frame.shown, film, bounds=bounds, turned=azimuth)
    return view.over(behind(film)).clip(0, 1)


def _squared(picture: AnyArray) -> AnyArray:
    """As large as fits, on black."""
    small = fit(picture, SIZE, SIZE)
    rows, columns = small.shape[:2]
    square = np.zeros((SIZE, SIZE, 3), np.float32)
    top, left = (SIZE - rows) // 2, (SIZE - columns) // 2
    square[top : top + rows, left : left + columns] = small
    return square


if __name__ == "__main__":
    main()
