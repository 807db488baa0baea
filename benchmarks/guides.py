"""How far the strokes of a painting run from its guide, seen from several sides.

    python benchmarks/guides.py SMOKE PAINTED GUIDE FRAME [FRAME ...]

Tells, for each frame and over all, the mean angle in degrees between strokes, as the structure
tensor of views has them, and the guide as far as it lies in the surface that is seen; weighed by
how strong and how straight strokes are; at two blurs of the picture. Strokes that take no heed of
the guide are at 45 degrees.
"""

import sys
from pathlib import Path

import numpy as np

from vnca.core import AnyArray
from vnca.core.camera import view_axes
from vnca.core.volume import Volume
from vnca.direction import Direction, Inputs, Moment
from vnca.direction.grammar import parsed_guide
from vnca.direction.guides import inwards, unit
from vnca.direction.values import Value
from vnca.features.strokes import distance_inside, structure_tensor
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import read_colour
from vnca.io.provenance import read_provenance
from vnca.io.sequence import find_frames
from vnca.io.smoke_format import NO_VELOCITY
from vnca.metrics.setup import Coloured, Setup, Viewpoint
from vnca.metrics.style import perceived
from vnca.training.scenes.smoke import smoke_bounds

VIEWS = [Viewpoint(azimuth, 8.0) for azimuth in (0.0, 90.0, 180.0, 270.0)]
PLAIN = SmokeFormat(velocity_grid=NO_VELOCITY)
CELLS_OF_BLUR = 0.5, 1.0
"""Of the gradients. Strokes are two cells wide: a quarter of that sees the marks in them, too."""
LEAST = 0.5
"""Part of a guide that lies in the picture, from which on it has a direction there."""


def main(smoke: str, painted: str, text: str, *numbers: str) -> None:
    """Print the mean angle of each view and over all."""
    guide = parsed_guide(text, "guide")
    frames = {frame.number: frame.path for frame in find_frames(smoke)}
    files = {frame.number: frame.path for frame in find_frames(painted)}
    sums = np.zeros((len(CELLS_OF_BLUR), 2))
    for number in map(int, numbers):
        volume = read_smoke(frames[number], frame=number)
        moment = Moment(volume, volume.box, 0.01, inputs=Inputs({number: frames[number]}))
        Direction(guide=text).require(moment.inputs)
        for view in VIEWS:
            found = angles(moment, guide, files[number], view)
            sums += found
            print(number, view.azimuth, *means(found), flush=True)
    print("mean angle:", *means(sums))


def means(sums: AnyArray) -> list[str]:
    """The mean angle for each blur."""
    return [f"{total / weight:.1f}" for total, weight in sums]


def angles(moment: Moment, guide: Value, path: Path, view: Viewpoint) -> AnyArray:
    """The sum of angles in a view, weighed, and that of the weights, for each blur."""
    shown, told = read_smoke(path, PLAIN), read_provenance(path)
    colour = read_colour(path, PLAIN, grid="Cd", box=shown.box)
    assert told is not None, f"{path} was painted"
    assert colour is not None, f"{path} was painted"
    refine = round(moment.smoke.voxel_size[0] / shown.voxel_size[0])
    box = smoke_bounds(moment.smoke, float(moment.smoke.density.max()))
    setup = Setup(box.refined(refine), told.extinction * shown.cell_length)
    seen = setup.look(Coloured(shown.density, colour, shown.origin), view)
    doubled = setup.look(
        Coloured(shown.density, _doubled(moment, guide, shown, refine, view), shown.origin), view
    )
    where = seen.opacity > 0.9
    cosine, sine, _ = np.moveaxis(
        2 * doubled.colour / np.maximum(seen.opacity, 0.1)[..., None] - 1, -1, 0
    )
    colours = perceived(seen.colour / np.maximum(seen.opacity, 0.4)[..., None])
    colours = np.where(where[..., None], colours, colours[where].mean(0))
    wanted, length = np.arctan2(sine, cosine) / 2, np.hypot(cosine, sine)
    found = []
    for cells in CELLS_OF_BLUR:
        blur = cells * setup.scale * refine
        inside = distance_inside(where) > 3 * blur
        across, turned, _ = structure_tensor(colours, inside, blur)
        # Across strokes, towards growing columns and rows; the guide is told upwards.
        strokes = np.arctan2(-turned, across) / 2 + np.pi / 2
        apart = np.abs((strokes - wanted + np.pi / 2) % np.pi - np.pi / 2)
        weights = np.hypot(across, turned) * inside * (length > LEAST**2)
        found.append([(np.degrees(apart) * weights).sum(), weights.sum()])
    return np.array(found)


def _doubled(moment: Moment, guide: Value, shown: Volume, refine: int, view: Viewpoint) -> AnyArray:
    """The cosine and sine of twice the angle of the guide in a view, cell by cell, as a colour.

    As long as the square of what of it lies in the picture; as strokes have no sign.
    """
    cells = np.argwhere(shown.density > 0) + shown.origin
    places = (cells + 0.5) / refine - 0.5
    places = np.rint(places).astype(np.int32)
    along, normal = unit(np.asarray(guide.at(moment, places))), unit(inwards(moment, places))
    along = along - (along * normal).sum(1, keepdims=True) * normal
    right, up, _ = view_axes(*view)
    x, y = along @ right, along @ up
    found = np.full((*shown.density.shape, 3), 0.5, np.float32)
    at = tuple((cells - shown.origin).T)
    found[at] = np.stack([x * x - y * y, 2 * x * y, 0 * x], -1) / 2 + 0.5
    return found


if __name__ == "__main__":
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
