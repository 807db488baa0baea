# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's fluid simulator leaves on disk, and where its cells lie in the domain.

Its OpenVDB files place cell (0, 0, 0) at the world's origin. The files `config/config_####.uni`
beside them say where it is in the domain, which an adaptive domain changes from frame to frame.
Files of an adaptive domain have a wrong length of cells, too: the domain's longest side divided by
the cells that it has at the moment.
"""

import gzip
import re
import struct
from dataclasses import dataclass
from pathlib import Path

from .problem import ProblemError

Three = tuple[float, float, float]
_CONFIG = struct.Struct("<i 3i f f 3f 3f 3f 3i 3f 16f 3i 3i 3i")
DATA, NOISE = "data/fluid_data", "noise/fluid_noise"
"""What files of the simulation and of its noise are called in the cache."""


@dataclass(frozen=True)
class Config:
    """Where the cells of a frame lie.

    Attributes:
        lower: Least corner of the domain, in its own space.
        upper: Greatest corner.
        cells: Of the whole domain, along each axis.
        first: The cell of the whole domain that is cell (0, 0, 0) of the files.
    """

    lower: Three
    upper: Three
    cells: tuple[int, int, int]
    first: tuple[int, int, int]

    @property
    def is_whole(self) -> bool:
        """Whether the files hold the domain from its corner on."""
        return self.first == (0, 0, 0)


def read_config(path: Path) -> Config:
    """Where the cells of a frame lie, as the simulator notes it beside each frame.

    Raises:
        ProblemError: If the file is not one of the simulator's.
    """
    try:
        with gzip.open(path) as file:
            numbers = _CONFIG.unpack(file.read(_CONFIG.size))
    except (OSError, EOFError, struct.error) as error:
        raise ProblemError(f"{path}: cannot be read ({error}); bake the domain again") from error
    cells, first = numbers[37:40], numbers[40:43]
    if not all(1 <= n <= 100_000 for n in cells) or not all(0 <= n < 100_000 for n in first):
        raise ProblemError(f"{path}: tells of no cells; bake the domain again")
    return Config(numbers[6:9], numbers[9:12], cells, first)


@dataclass(frozen=True)
class Placement:
    """From the world of the files to the space of the domain, axis by axis.

    Attributes:
        scale: Lengths of a cell in the domain, by the length of a cell in the files.
        shift: Where the files' origin, the middle of cell (0, 0, 0), is.
    """

    scale: Three
    shift: Three


def placement(config: Config, voxel: float) -> Placement:
    """Where the cells of a whole domain lie in it.

    Args:
        config: Of any frame.
        voxel: Length of a cell as files of a whole domain have it.
    """
    edges = [(u - lo) / n for lo, u, n in zip(config.lower, config.upper, config.cells)]
    x, y, z = (edge / voxel for edge in edges)
    a, b, c = (lo + edge / 2 for lo, edge in zip(config.lower, edges))
    return Placement((x, y, z), (a, b, c))


def frames(folder: Path, kind: str) -> dict[int, Path]:
    """The files of a cache by the number of their frame.

    Args:
        folder: The cache directory of the domain.
        kind: `DATA` or `NOISE`.
    """
    where, _, name = kind.rpartition("/")
    found = re.compile(re.escape(name) + r"_(-?\d+)\.vdb")
    paths = (folder / where).glob(f"{name}_*.vdb")
    matched = [(found.fullmatch(path.name), path) for path in paths]
    return dict(sorted((int(match[1]), path) for match, path in matched if match))


def config_path(folder: Path, number: int) -> Path:
    """What the simulator notes of a frame."""
    return folder / "config" / f"config_{number:04d}.uni"
