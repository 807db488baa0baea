"""Jobs that paint shots: training where one asks for it, painting in chunks, a film."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from vnca.core.errors import OptionError
from vnca.direction.shot import Shot
from vnca.farm.job import CHUNK, Frames, Job, Task
from vnca.io.sequence import find_frames
from vnca.recipe.paint import PaintRun, over_shot

STATE = ".state_{:04d}.safetensors"
"""What a chunk hands over to the next, beside the painted frames, by its last frame."""


@dataclass(frozen=True)
class Chunks:
    """How shots are cut into chunks, and in what they vary."""

    chunk_size: int = 16
    """Frames that a machine paints at a time."""
    handover: Literal["state", "preroll"] = "state"
    """How a chunk follows the one before: with the state that it left, so that one is painted after
    the other; or after a pre-roll, in which frames are stepped through and not painted, so that
    all can be painted at a time."""
    preroll: int | None = None
    """With `handover` preroll: how many frames are stepped through before a chunk. All of them,
    which is exact, unless given; after fewer a seam can be seen."""
    styles: tuple[str, ...] = ()
    """Paint every shot in each of these styles of the library, instead of its own."""
    seeds: tuple[int, ...] = ()
    """Paint every shot with each of these seeds, instead of its own."""

    def __post_init__(self) -> None:
        if not 1 <= self.chunk_size <= 150:
            raise OptionError(f"`chunk_size` {self.chunk_size}: expected 1 to 150")
        if self.preroll is not None and self.handover != "preroll":
            raise OptionError("`preroll`: needs `handover` preroll")
        if self.preroll is not None and self.preroll < 0:
            raise OptionError(f"`preroll` {self.preroll}: must not be negative")
        for name in ("styles", "seeds"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise OptionError(f"`{name}` {' '.join(map(str, values))}: one is there twice")


def shots_job(paths: Sequence[Path], chunks: Chunks, program: Sequence[str]) -> Job:
    """The job that paints shots, all side by side.

    Args:
        paths: Shot files.
        chunks: How they are cut.
        program: How vnca is called.

    Raises:
        FileFormatError: If one cannot be read.
        SequenceError: If its smoke is not there.
        OptionError: If it asks for what cannot be, or two would paint into one folder.
    """
    tasks: list[Task] = []
    folders: dict[Path, str] = {}
    for path in paths:
        asked = Shot.load(path)
        shot = asked.applied(PaintRun(sequence="", out=Path()))
        if "out" not in asked.values:
            raise OptionError(f"{path}: names no `out`, the folder to paint to")
        for label, given in _variants(path, shot, chunks):
            folder = given.out.absolute()
            if (other := folders.setdefault(folder, label)) is not label:
                raise OptionError(f"{folder}: both {other} and {label} would paint there")
            tasks += _tasks(label, path.absolute(), given, chunks, tuple(program))
    return Job(" ".join(dict.fromkeys(path.stem for path in paths)), tuple(tasks))


def _variants(path: Path, shot: PaintRun, chunks: Chunks) -> Iterator[tuple[str, PaintRun]]:
    """A shot in the styles and with the seeds that are asked for, and what each is called."""
    for style in chunks.styles or (None,):
        for seed in chunks.seeds or (None,):
            words = [str(word) for word in (style, seed) if word is not None]
            given = shot
            if style is not None:
                given = over_shot(PaintRun(sequence="", out=Path(), style=style), shot)
            if seed is not None:
                given = replace(given, seed=seed)
            out = shot.out / "_".join(words) if words else shot.out
            given = replace(given, out=out)
            given.require_one_style()
            yield " ".join([path.stem, *words]), given


def _tasks(
    label: str, path: Path, given: PaintRun, chunks: Chunks, program: tuple[str, ...]
) -> Iterator[Task]:
    """The tasks of a shot."""
    numbers = tuple(f.number for f in find_frames(given.sequence, given.frames))
    frames = Frames(numbers, chunks.chunk_size)
    call = (*program, "paint", str(path), "--out", str(given.out.absolute()))
    if chunks.styles:
        call += ("--style", str(given.style))
    if chunks.seeds:
        call += ("--seed", str(given.seed))
    call += ("--resume", "--only")
    done: tuple[str, ...] = ()
    if not given.is_trained:
        yield Task(f"{label} train", (*call, "train"))
        done = (f"{label} train",)
    paint = (*call, "paint", "--chunk")
    if chunks.handover == "preroll":
        words = (*paint, CHUNK)
        if chunks.preroll is not None:
            words += ("--preroll", str(chunks.preroll))
        yield Task(f"{label} paint", words, done, frames)
        done = (f"{label} paint",)
    else:
        state = None
        for first, last in frames.chunks():
            task = Task(f"{label} paint {first}-{last}", (*paint, f"{first}-{last}"), done)
            if state is not None:
                task = replace(task, words=(*task.words, "--state-in", state))
            if last != numbers[-1]:
                state = str(given.out.absolute() / STATE.format(last))
                task = replace(task, words=(*task.words, "--state-out", state))
            yield task
            done = (task.name,)
    if not given.without_film:
        yield Task(f"{label} film", (*call, "film"), done)
