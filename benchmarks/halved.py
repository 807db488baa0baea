"""A sequence of smoke on half as many cells along each axis, for methods that are slow.

Run `python benchmarks/halved.py SMOKE --out DIR`, with `vnca train`'s options of reading smoke. A
cell takes the mean density of eight, and their mean velocity weighted by it.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from vnca.core import Box, FloatArray
from vnca.core.files import writable_folder
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.io import SmokeFormat
from vnca.io.painted import write_smoke
from vnca.recipe import SILENT
from vnca.recipe.sequence import open_sequence, sequence_region, volumes


@dataclass(frozen=True)
class Options:
    """What is halved."""

    sequence: tyro.conf.Positional[str]
    """A folder, a pattern or a file."""
    out: Path
    """Folder for the frames, which keep their names."""
    frames: str | None = None
    """Such as 30-49; all unless given."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""


def halved(smoke: Volume, lattice: Lattice) -> Volume:
    """Smoke on cells twice as long, whose corners are at even cells of the lattice."""
    lower = tuple(int(first) // 2 * 2 for first in smoke.box.lower)
    upper = tuple(-(-int(end) // 2) * 2 for end in smoke.box.upper)
    box = Box((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))
    density = smoke.density_field.dense(box)
    velocity = None
    if smoke.velocity_field is not None:
        weight = density[..., None] + np.float32(1e-12)
        carried = of_eight(weight * smoke.velocity_field.dense(box)) / of_eight(weight)
        velocity = (carried / 2).astype(np.float32)
    mean = of_eight(density[..., None])[..., 0]
    coarse = np.diag([2.0, 2.0, 2.0, 1.0])
    coarse[:3, 3] = 0.5
    x, y, z = (first // 2 for first in lower)
    return Volume(mean, velocity, (x, y, z), lattice.to_world @ coarse, smoke.frame)


def of_eight(values: FloatArray) -> FloatArray:
    """Means `[x / 2, y / 2, z / 2, c]` of `[x, y, z, c]`."""
    x, y, z, count = values.shape
    return values.reshape(x // 2, 2, y // 2, 2, z // 2, 2, count).mean(axis=(1, 3, 5))


def main() -> None:
    options = tyro.cli(Options, description=__doc__)
    sequence = open_sequence(options.sequence, options.frames, SILENT)
    region = sequence_region(sequence, options.smoke, SILENT)
    out = writable_folder(options.out)
    frames = volumes(sequence, options.smoke, region.lattice)
    for frame, smoke in zip(sequence, frames, strict=True):
        write_smoke(out / f"{frame.path.stem}.vdb", halved(smoke, region.lattice))


if __name__ == "__main__":
    main()
