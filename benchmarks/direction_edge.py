"""Whether a painting flickers along the edge of a mask more than elsewhere.

    python benchmarks/direction_edge.py SMOKE PAINTED VALUE FIRST LAST

Follows the smoke of frames `FIRST` to `LAST` from each to the next, as evaluation does, and tells
the warp error of pixels where the mask VALUE is between a tenth and nine tenths, and of all others:
the root mean square change of colours as they are perceived, and that over the contrast of its own
pixels (1 is that of unrelated ones).
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from vnca.core import BoolArray, Box, FloatArray
from vnca.direction import Moment
from vnca.direction.carried import carry
from vnca.direction.grammar import parsed
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import read_colour
from vnca.io.provenance import read_provenance
from vnca.io.sequence import find_frames
from vnca.io.smoke_format import NO_VELOCITY
from vnca.metrics.coherence import Coherence
from vnca.metrics.setup import OPAQUE, Coloured, Setup, Viewpoint
from vnca.metrics.style import perceived

VIEW = Viewpoint(0.0, 8.0)
EDGE = 0.1, 0.9
KINDS = "change", "change over contrast"
PLAIN = SmokeFormat(velocity_grid=NO_VELOCITY)


def main(smoke: str, painted: str, text: str, first: str, last: str) -> None:
    """Print the warp error at the edge and elsewhere, of each frame and over all."""
    value, carried = parsed(text, "value"), None
    frames, files = find_frames(smoke), {f.number: f.path for f in find_frames(painted)}
    box, fine = Box((0, 0, 0), (0, 0, 0)), read_smoke(files[int(last)], PLAIN)
    for frame in frames:
        box = box.union(read_smoke(frame.path, PLAIN).box)
    coarse = read_smoke(frames[-1].path, PLAIN)
    refine = round(coarse.voxel_size[0] / fine.voxel_size[0])
    told = read_provenance(files[int(last)])
    assert told is not None, f"{painted} was painted"
    setup = Setup(box.refined(refine), told.extinction * fine.cell_length)
    coherence = Coherence(lambda *_: np.zeros((setup.size, setup.size, 2), np.float32))
    errors, before = [], None
    for frame in frames:
        if frame.number > int(last):
            break
        volume = read_smoke(frame.path, frame=frame.number)
        moment = Moment(volume, box, 0.01)
        carried = carry(carried, value.parts(), moment)
        if frame.number < int(first):
            continue
        moment = replace(moment, carried=carried)
        path = files[frame.number]
        shown = read_smoke(path, PLAIN)
        colour = read_colour(path, PLAIN, grid="Cd", box=shown.box)
        assert colour is not None, f"{path} was painted"
        finer = volume.refined(refine)
        pair = setup.look_twice(
            Coloured(shown.density, colour, shown.origin), Coloured.plain(finer), VIEW
        )
        coherence.add(frame.number, pair, setup.motion(finer, VIEW))
        cells = np.indices(finer.density.shape).reshape(3, -1).T + finer.origin
        mask = np.broadcast_to(value.at(moment, (cells + 0.5) / refine - 0.5), len(cells))
        mask = np.repeat(mask.reshape(*finer.density.shape, 1), 3, axis=-1).astype(np.float32)
        seen = setup.look(Coloured(finer.density, mask, finer.origin), VIEW)
        part = seen.colour[..., 0] / np.maximum(seen.opacity, OPAQUE)
        colours = perceived(pair.painted.colour / np.maximum(pair.painted.opacity, 0.4)[..., None])
        change = coherence.difference
        if before is not None and change is not None:
            errors.append([*parts_of(change, *before)])
            print(frame.number, *(f"{error:.4f}" for error in np.ravel(errors[-1])), flush=True)
        before = colours, part, pair.where
    for kind, (edge, elsewhere) in zip(KINDS, np.mean(errors, axis=0).T, strict=True):
        print(f"{kind}: edge {edge:.4f}, elsewhere {elsewhere:.4f}, ratio {edge / elsewhere:.3f}")


def parts_of(
    change: FloatArray, colours: FloatArray, part: FloatArray, where: BoolArray
) -> Iterator[tuple[float, float]]:
    """Change, and change over contrast, at the edge of the mask and elsewhere."""
    followed = where & (change > 0)
    at_edge = (part > EDGE[0]) & (part < EDGE[1])
    for region in (followed & at_edge, followed & ~at_edge):
        contrast = np.sqrt(2 * colours[region].var(axis=0).sum())
        mean = np.sqrt(np.square(change[region]).mean())
        yield float(mean), float(mean / contrast)


if __name__ == "__main__":
    main(*map(str, map(Path, sys.argv[1:3])), *sys.argv[3:])
