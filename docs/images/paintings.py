"""Makes `paintings.png`: a row a painting, the picture and four frames painted with it.

    python docs/images/paintings.py OUT STYLE PAINTED [STYLE PAINTED ...]

STYLE is a picture, PAINTED a folder that `vnca stylize` wrote with a rule trained on it.
"""

import sys
from pathlib import Path

from vnca.cli.film import FilmConfig
from vnca.cli.render import Render, strip
from vnca.cli.sequence import open_sequence
from vnca.io.image import fit, read_image, write_image
from vnca.io.sheet import contact_sheet

SIZE = 256
BACKGROUND = (0.005, 0.005, 0.007)


def main(out: str, *pairs: str) -> None:
    """Write the sheet."""
    view = FilmConfig(rows=SIZE, columns=SIZE)
    rows = []
    for style, painted in zip(pairs[::2], pairs[1::2], strict=True):
        frames = strip(open_sequence(painted, None), Render(painted, Path(out), film=view), 4)
        rows.append([fit(read_image(Path(style)), SIZE, SIZE), *frames])
    write_image(Path(out), contact_sheet(rows, background=BACKGROUND))


if __name__ == "__main__":
    main(*sys.argv[1:])
