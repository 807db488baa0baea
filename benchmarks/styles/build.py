"""Pack trained rules into the library of styles of the package.

python benchmarks/styles/build.py SMOKE OUT NAME=RUN[+RUN …] ...

SMOKE is a frame that thumbnails are painted on, OUT the folder of the library, RUN the folder of a
training: of a picture here, drawn by pictures.py, or in the package. Of several runs the rule is
the mean, which keeps what they have in common where one began with another. The ink is from an
earlier version. All others learned on four smokes by turns, frame 45 of one made in Blender and
frame 30 of three that `vnca simulate` makes of 48 cells across. Stained glass, church and embers
went on from the style of the same name as it was before:

    vnca train FRAME PICTURE -o RUN --init STYLE --more-frames BILLOWY JET SPHERE
        --iterations 240 --pool.reseed-every 40 --pool.size 2 -s 1

The others went from it through a texture first:

    vnca train FRAME PICTURE -o T --graft STYLE --texture 100 --iterations 4 -s 1
    vnca train FRAME PICTURE -o RUN --init T/texture --more-frames BILLOWY JET SPHERE
        --iterations 360 --pool.reseed-every 40 -s 1

Two went on from there. The harvest, twice, the second time with `-s 3`:

    vnca train FRAME PICTURE -o LONGER --init RUN --more-frames BILLOWY JET SPHERE
        --iterations 600 --pool.reseed-every 40 -s 2

The stained glass with `--view.thinnest 0.03` besides; it is `stained_glass=LONGER+RUN`, as the
longer training alone has too much lead after some seconds of a film.

Café, church and harvest went on with what is seen compared, too:

    vnca train FRAME PICTURE -o RUN --init STYLE --more-frames BILLOWY JET SPHERE
        --iterations 300 --consistency 0.5 --pool.reseed-every 40 -s 3

The others have `--consistency 0`: lines become broad by it.

The woodcut has `--appearance.style-scale 2 --appearance.style 1` in both: by distributions alone
its lines become blots.

What a model tells of the smoke that it was trained on is left out: the library paints
other smoke.
"""

import dataclasses
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import vnca
from vnca.io.picture import resize, to_srgb8
from vnca.recipe.film import FilmConfig, picture
from vnca.recipe.sequence import region_bounds
from vnca.rule.library import SUFFIX, THUMBNAIL
from vnca.rule.mixing import blended, require_blendable
from vnca.rule.model import Model

SIZE = 160
"""Rows and columns of a thumbnail, pixels."""
TITLES = {
    "cafe": "Vincent van Gogh, Café Terrace at Night (1888)",
    "church": "Vincent van Gogh, The Church at Auvers (1890)",
    "harvest": "Vincent van Gogh, The Harvest (1888)",
    "circuit": "copper traces on a green board",
    "embers": "glowing cracks in a black crust",
    "engraving": "lines of ink on paper that swell and end",
    "frost": "pale feathers of ice on deep blue",
    "fur": "tawny strands",
    "ink": "black and sepia ink in water",
    "marble": "white stone with golden veins",
    "mosaic": "small tiles in flowing rows",
    "rust": "flaking paint over rust",
    "stained_glass": "leaded glass, lit from behind",
    "threads": "pale threads on dark teal",
    "watercolour": "washes with dark rims",
    "woodcut": "black lines cut in wood",
}


def main(smoke: Path, out: Path, runs: dict[str, list[Path]]) -> None:
    """Write a model and a thumbnail of each style."""
    out.mkdir(parents=True, exist_ok=True)
    for name, of_style in runs.items():
        model = packed(mean([vnca.load(run) for run in of_style]), name)
        model.save(out / (name + SUFFIX))
        (out / (name + THUMBNAIL)).write_bytes(thumbnail(model, smoke))
        print(name)


def mean(models: Sequence[Model]) -> Model:
    """The first of some models with the mean of their weights."""
    first, *others = models
    for other in others:
        require_blendable(first, other, "RUN")
    shares = np.full(len(models), 1 / len(models), np.float32)
    return dataclasses.replace(first, rule=blended([model.rule for model in models], shares))


def packed(model: Model, name: str) -> Model:
    """The model with nothing in it of the smoke that it was trained on but its place in none."""
    kept = ("style", "preset", "iterations", "seed", "features", "picture_cells", "origins")
    training = {"title": TITLES[name]} | {k: v for k, v in model.training.items() if k in kept}
    return Model(dataclasses.replace(model.rule, place=None), training, model.style)


def thumbnail(model: Model, smoke: Path) -> bytes:
    """A WebP picture of a frame painted with a model."""
    (frame,) = vnca.stylize(model, smoke, refine=3, velocity_units="mantaflow")
    shown = frame.shown
    bounds = region_bounds(shown.smoke.box, shown.smoke.index_to_world)
    film = FilmConfig(rows=2 * SIZE, columns=2 * SIZE, elevation=10.0)
    view = picture(shown, film, bounds=bounds, turned=0.0)
    seen = resize(view.over([0.01] * 3), SIZE, SIZE)
    stream = io.BytesIO()
    Image.fromarray(to_srgb8(np.clip(seen, 0, 1))).save(stream, "WEBP", quality=85)
    return stream.getvalue()


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    given = dict(word.split("=", 1) for word in sys.argv[3:])
    runs = {name: [Path(run) for run in of_style.split("+")] for name, of_style in given.items()}
    main(Path(sys.argv[1]), Path(sys.argv[2]), runs)
