# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist asks for, and the words in which vnca is told of it."""

import re
from dataclasses import dataclass, replace
from typing import Any, Literal

from .cache import Placement

Kind = Literal["paint", "preview", "train", "check"]
STAGED = "smoke_####.vdb"
"""What frames are called that were copied to be painted; the worker calls them so, too."""
PICTURES = {"draft": 20}
"""Iterations of a training between two pictures of it; 50 in other presets."""
_HASHES = re.compile("#+")


@dataclass(frozen=True)
class Staged:
    """A frame that is copied before it is painted, with its cells in their places.

    Attributes:
        number: Of the frame.
        data: File of the simulation.
        noise: File of its noise, with the finer density; None without.
        first: Cell of the whole domain that is cell (0, 0, 0) of the file of the simulation; None
            where the cells lie where they should already.
        voxel: Length of its cells.
        finer: Cells of the noise along an edge of one of the simulation.
        keeps: Whether its density is kept beside the painted one, to be seen outside a mask.
    """

    number: int
    data: str
    noise: str | None = None
    first: tuple[int, int, int] | None = None
    voxel: float = 1.0
    finer: int = 1
    keeps: bool = False


@dataclass(frozen=True)
class Smoke:
    """A sequence of smoke as it lies on disk.

    Attributes:
        name: Of the object.
        sequence: A pattern or a file, as `vnca paint` takes it; a folder to be made where frames
            are staged.
        numbers: Of the frames that there are, in order.
        units: Of the velocity.
        fps: Frames a second of the scene.
        time_scale: Of the simulation.
        up_axis: Which axis of the files points up.
        placement: From the files' world to the object; None if they are the same.
        staged: What to copy, if cells are not where they belong or a mask needs more grids.
        is_sequence: Whether `sequence` has `#` for the number of a frame.
    """

    name: str
    sequence: str
    numbers: tuple[int, ...]
    units: str
    fps: float
    time_scale: float = 1.0
    up_axis: str = "z"
    placement: Placement | None = None
    staged: tuple[Staged, ...] = ()
    is_sequence: bool = True

    def only(self, numbers: tuple[int, ...]) -> "Smoke":
        """Some of its frames."""
        staged = tuple(one for one in self.staged if one.number in numbers)
        return replace(self, numbers=numbers, staged=staged)

    def file(self, number: int) -> str:
        """The file of a frame."""
        if not self.is_sequence:
            return self.sequence
        (*_, last) = _HASHES.finditer(self.sequence)
        return (
            f"{self.sequence[: last.start()]}{number:0{len(last[0])}d}{self.sequence[last.end() :]}"
        )

    def masked(self, folder: str) -> "Smoke":
        """The same, copied into a folder with what a mask needs."""
        staged = self.staged or tuple(Staged(n, self.file(n)) for n in self.numbers)
        sequence = f"{folder}/{STAGED}"
        if not self.is_sequence:
            sequence = staged_file(folder, self.numbers[0])
        return replace(
            self, sequence=sequence, staged=tuple(replace(one, keeps=True) for one in staged)
        )


@dataclass(frozen=True)
class Look:
    """How it is painted.

    Attributes:
        style: A style of the library; None where a model is given.
        model: A model file or the folder of a run.
        density_strength: How much of the change of density is painted.
        refine: Cells painted along an edge of one of the smoke.
        seed: Same seed, same painting.
    """

    style: str | None
    model: str | None
    density_strength: float = 1.0
    refine: int = 2
    seed: int = 0


def smoke_words(smoke: Smoke) -> list[str]:
    """How the files are read."""
    words = ["--velocity-units", smoke.units, "--up-axis", smoke.up_axis]
    if smoke.units != "cells/frame":
        words += ["--fps", repr(smoke.fps), "--time-scale", repr(smoke.time_scale)]
    return words


def paint_words(
    smoke: Smoke, look: Look, out: str, frames: str, *, goes_on: bool = False
) -> list[str]:
    """Paint frames into the folder `painted` of another.

    Args:
        smoke: What is painted.
        look: How.
        out: The folder.
        frames: Such as `1-24`.
        goes_on: Whether an interrupted painting is gone on with; else it is replaced.
    """
    style = [] if look.style is None else ["--style", look.style]
    return [
        *("paint", smoke.sequence, *([look.model] if look.model else []), *style),
        *("--out", out, *(["--frames", frames] if smoke.is_sequence else [])),
        *("--refine", str(look.refine)),
        *("--seed", str(look.seed), "--density-strength", repr(look.density_strength)),
        *smoke_words(smoke),
        *("--without-film", "--resume" if goes_on else "--overwrite", "--json-progress"),
    ]


def train_words(
    smoke: Smoke, frame: str, picture: str, out: str, preset: str, seed: int
) -> list[str]:
    """Learn a style from a picture on a frame, in the folder of a run.

    Args:
        smoke: What the frame is of.
        frame: The file.
        picture: The picture.
        out: The folder.
        preset: How long and how well.
        seed: Same seed, same style.
    """
    return [
        *("train", frame, picture, "--out", out, "--preset", preset, "--seed", str(seed)),
        *("--preview-every", str(PICTURES.get(preset, 50))),
        *smoke_words(smoke),
        *("--overwrite", "--json-progress"),
    ]


def resume_words(out: str) -> list[str]:
    """Go on with the training in a folder, on what it began with."""
    return ["train", "--resume", out, "--json-progress"]


def staged_file(folder: str, number: int) -> str:
    """The file of a frame that was copied to be painted."""
    return f"{folder}/{STAGED.replace('####', f'{number:04d}')}"


def numbers_text(numbers: tuple[int, ...]) -> str:
    """Frames as `--frames` takes them: `1-24`, `3,7-9`."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(f"{a}" if a == b else f"{a}-{b}" for a, b in runs)


def velocity_scale(smoke: Smoke, units: str, voxel: float) -> tuple[str, float]:
    """Blender's unit and factor that make velocities of the files lengths of the object.

    For `Volume.velocity_unit` and `Volume.velocity_scale`. Mantaflow's velocities are tenths of a
    cell in a frame at 25 frames a second.

    Args:
        smoke: Whose velocity it is.
        units: As the files say; empty where they do not, and those of the smoke count.
        voxel: Length of a cell in the files.
    """
    units = units or smoke.units
    if units == "m/s":
        return "SECOND", smoke.time_scale
    if units == "mantaflow":
        return "FRAME", 0.1 * 25 / smoke.fps * smoke.time_scale * voxel
    return "FRAME", voxel


def job(kind: Kind, words: list[str], **facts: Any) -> dict[str, Any]:
    """What the worker is told, as JSON values."""
    return {"kind": kind, "words": words, **facts}
