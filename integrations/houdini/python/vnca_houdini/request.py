# SPDX-License-Identifier: Apache-2.0
"""What an artist asks for, and the words in which vnca is told of it."""

import math
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

PROGRAM = "VNCA"
"""The variable that names the program vnca, where that is not on the path."""
SOURCE = "smoke.%04d.vdb"
"""Smoke as it is written to be painted; paintings keep the name."""


class ProblemError(Exception):
    """What an artist can mend: a line that says what is wrong, and what to do."""


@dataclass(frozen=True)
class Painting:
    """A painting of VDBs.

    Attributes:
        folder: Of all its files.
        style: A style of the library, or empty.
        model: A picture to learn from, a model, or the folder of a run; or empty.
        first: First frame.
        last: Last frame.
        fps: Frames a second of the scene; velocity is in lengths of the world a second.
        time_scale: Of the solver.
        strength: Colour, from 0 to 1.
        density_strength: Change of the density, from 0 to 1.
        refine: Cells painted along an edge of one of the smoke.
        seed: Same seed, same painting.
    """

    folder: Path
    style: str
    model: str
    first: int
    last: int
    fps: float
    time_scale: float = 1.0
    strength: float = 1.0
    density_strength: float = 1.0
    refine: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        if bool(self.style) == bool(self.model):
            raise ProblemError("Choose a style of the library, or a picture or model: one of them")
        if self.last < self.first:
            raise ProblemError(f"There is no frame from {self.first} to {self.last}")

    @property
    def frames(self) -> range:
        """Their numbers."""
        return range(self.first, self.last + 1)

    def source(self, number: int) -> Path:
        """The file of the smoke of a frame."""
        return self.folder / "smoke" / (SOURCE % number)

    def painted(self, frame: float) -> Path:
        """The painted file that a frame shows: on sub-frames (`$FF`) that of the frame before."""
        return self.folder / "painted" / (SOURCE % math.floor(frame + 1e-4))

    def words(self, *, goes_on: bool = False) -> list[str]:
        """What vnca is told. Up is y, and velocity is in lengths of the world a second.

        Args:
            goes_on: Whether an interrupted painting is gone on with; else it is replaced.
        """
        style = ["--style", self.style] if self.style else [self.model]
        return [
            *("paint", str(self.folder / "smoke" / "smoke.####.vdb"), *style),
            *("--out", str(self.folder), "--frames", f"{self.first}-{self.last}"),
            *("--up-axis", "y", "--velocity-units", "m/s"),
            *("--fps", repr(self.fps), "--time-scale", repr(self.time_scale)),
            *("--strength", repr(self.strength)),
            *("--density-strength", repr(self.density_strength)),
            *("--refine", str(self.refine), "--seed", str(self.seed)),
            *("--without-film", "--resume" if goes_on else "--overwrite", "--json-progress"),
        ]


def program() -> str:
    """The program vnca.

    Raises:
        ProblemError: If it is not found.
    """
    told = os.environ.get(PROGRAM, "")
    found = shutil.which(told or "vnca")
    if found is None:
        where = f"{PROGRAM}={told} is no program" if told else "vnca is not on the path"
        raise ProblemError(f"{where}; install it (pip install vnca) and name it in {PROGRAM}")
    return found
