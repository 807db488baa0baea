"""Sequences of frames: which files a pattern, a folder and a range of frames mean.

A frame number is a whole number, not negative. Patterns with a number (`smoke_%04d.vdb`,
`smoke.$F4.vdb`, `smoke_####.vdb`, `smoke_%d.vdb`, `smoke.$F.vdb`) and globs (`*`, `?`) stand for
the name of a file; folders are taken as written.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import translate
from itertools import chain
from pathlib import Path
from typing import NamedTuple, overload

from vnca.errors import OptionError, SequenceError
from vnca.io.smoke_format import UP_AXES

MAX_FRAMES = 1_000_000
_NUMBER = re.compile(r"%0?(?P<printf>\d*)d|\$F(?P<houdini>\d*)|(?P<hashes>#+)")
_TRAILING = re.compile(r"\d{1,18}$", re.ASCII)
_RANGE = re.compile(r"\s*(\d{1,18})(?:\s*-\s*(\d{1,18})(?:\s*x\s*(\d{1,18}))?)?\s*", re.ASCII)


class Frame(NamedTuple):
    """A frame of a sequence: its number, and the file that holds it."""

    number: int
    path: Path


@dataclass(frozen=True)
class FrameSequence(Sequence[Frame]):
    """Frames by number.

    Attributes:
        frames: By increasing number, at least one.
        gaps: Numbers that were asked for, or lie between the first and the last frame where no
            range was given, and have no file.
    """

    frames: tuple[Frame, ...]
    gaps: tuple[int, ...] = ()

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Frame, ...]: ...
    def __getitem__(self, index: int | slice) -> Frame | tuple[Frame, ...]:
        return self.frames[index]

    def __len__(self) -> int:
        return len(self.frames)


def find_frames(pattern: str | Path, frames: str | None = None) -> FrameSequence:
    """The frames a pattern selects, by number.

    Args:
        pattern: A file; a folder with one numbered sequence of `.vdb` or `.npz` files, or in
            Mantaflow's layout (`d/` and `v/`); a name with a frame number; or a glob over names
            that end in a number. A single file without a number is frame 0.
        frames: Which numbers to take, see `parse_frames`; by default all.

    Raises:
        SequenceError: If nothing is found, several sequences match, or one number has two files.
        OptionError: If `frames` cannot be read.
    """
    wanted = None if frames is None else parse_frames(frames)
    path = Path(pattern).expanduser()
    if path.is_file():
        found = [Frame(_trailing_number(path) or 0, path)]
    elif path.is_dir():
        found = _one_sequence(path, _folder_sequences(path))
    elif _NUMBER.search(path.name):
        found = _matching_number(path)
    elif any(sign in path.name for sign in "*?["):
        matches = re.compile(translate(path.name)).match
        found = _one_sequence(path, _sequences(p for p in _files(path) if matches(p.name)))
    else:
        raise SequenceError(f"{path}: no such file or folder{_beside(path)}")
    return _selected(path, sorted(found), wanted)


def parse_frames(text: str) -> tuple[int, ...]:
    """Frame numbers written as `30-53`, `30-53x2` (every second) or `1,4,7-9`; sorted, each once.

    Raises:
        OptionError: If the text is something else, a range runs backwards or is huge.
    """
    ranges: list[range] = []
    for part in text.split(","):
        match = _RANGE.fullmatch(part)
        if match is None:
            raise OptionError(
                f"frames: expected something like 30-53, 30-53x2 or 1,4,7-9, got {text!r}"
            )
        first = int(match[1])
        last, step = int(match[2] or first), int(match[3] or 1)
        if last < first or step == 0:
            raise OptionError(f"frames: {part.strip()!r} is an empty range")
        ranges.append(range(first, last + 1, step))
    if sum(map(len, ranges)) > MAX_FRAMES:
        raise OptionError(f"frames: {text!r} asks for more than {MAX_FRAMES} frames")
    return tuple(sorted(set(chain.from_iterable(ranges))))


def format_frames(numbers: Iterable[int]) -> str:
    """Frame numbers as `parse_frames` reads them: `1,4,7-9`."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(f"{a}" if a == b else f"{a}-{b}" for a, b in runs)


def _selected(path: Path, found: list[Frame], wanted: tuple[int, ...] | None) -> FrameSequence:
    by_number: dict[int, Frame] = {}
    for frame in found:
        other = by_number.setdefault(frame.number, frame)
        if other is not frame:
            raise SequenceError(
                f"{path}: frame {frame.number} has two files, "
                f"{other.path.name} and {frame.path.name}"
            )
    if wanted is None:
        first, last = found[0].number, found[-1].number
        if last - first > MAX_FRAMES:
            raise SequenceError(
                f"{path}: frame numbers run from {first} to {last}; choose some with --frames"
            )
        wanted = tuple(range(first, last + 1))
    chosen = tuple(by_number[number] for number in wanted if number in by_number)
    if not chosen:
        raise SequenceError(
            f"{path}: no frame of {format_frames(wanted)}; there are {format_frames(by_number)}"
        )
    return FrameSequence(chosen, tuple(number for number in wanted if number not in by_number))


def _matching_number(path: Path) -> list[Frame]:
    """Files whose name is `path.name` with a number in place of its token."""
    if len(_NUMBER.findall(path.name)) > 1:
        raise SequenceError(f"{path}: expected one frame number in the name, found several")
    token = _NUMBER.search(path.name)
    assert token is not None
    digits = int(token["printf"] or token["houdini"] or len(token["hashes"] or "#"))
    before, after = re.escape(path.name[: token.start()]), re.escape(path.name[token.end() :])
    name = re.compile(rf"{before}(\d{{{digits},18}}){after}", re.ASCII)
    matches = ((name.fullmatch(file.name), file) for file in _files(path))
    found = [Frame(int(match[1]), file) for match, file in matches if match]
    if not found:
        raise SequenceError(f"{path}: no file matches{_beside(path)}")
    return found


def _folder_sequences(folder: Path) -> dict[str, list[Frame]]:
    """Sequences in a folder; Mantaflow's `d/` counts as one where nothing else is there."""
    files = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in UP_AXES]
    sequences = _sequences(files)
    if not sequences and (folder / "d").is_dir():
        sequences = _sequences(sorted((folder / "d").glob("*.npz")))
    return sequences


def _sequences(files: Iterable[Path]) -> dict[str, list[Frame]]:
    """Numbered files, grouped by what they share, under the pattern that selects them.

    Hidden files are none: a program that was killed leaves such.
    """
    groups: dict[tuple[str, str], list[Frame]] = {}
    for file in files:
        number = _trailing_number(file)
        if number is not None and not file.name.startswith(".") and file.is_file():
            prefix = _TRAILING.sub("", file.stem)
            groups.setdefault((prefix, file.suffix), []).append(Frame(number, file))
    return {
        f"{prefix}{_token(prefix, members)}{suffix}": members
        for (prefix, suffix), members in groups.items()
    }


def _token(prefix: str, members: list[Frame]) -> str:
    digits = [frame.path.stem[len(prefix) :] for frame in members]
    padded = any(d.startswith("0") and len(d) > 1 for d in digits)
    return f"%0{min(map(len, digits))}d" if padded else "%d"


def _one_sequence(path: Path, sequences: dict[str, list[Frame]]) -> list[Frame]:
    if not sequences:
        raise SequenceError(f"{path}: no numbered .vdb or .npz file{_beside(path)}")
    if len(sequences) > 1:
        raise SequenceError(
            f"{path}: several sequences; choose one of {', '.join(sorted(sequences))}"
        )
    return next(iter(sequences.values()))


def _trailing_number(file: Path) -> int | None:
    match = _TRAILING.search(file.stem)
    return int(match[0]) if match else None


def _files(path: Path) -> list[Path]:
    """What lies in the folder of `path`, sorted by name."""
    try:
        return sorted(path.parent.iterdir())
    except OSError as error:
        raise SequenceError(f"{path}: {path.parent} cannot be listed ({error.strerror})") from error


def _beside(path: Path) -> str:
    """What there is instead, for messages."""
    folder = path if path.is_dir() else path.parent
    if not folder.is_dir():
        return f"; there is no folder {folder}"
    names = sorted(file.name for file in folder.iterdir())
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return f"; {folder} holds {', '.join(names[:4]) or 'nothing'}{more}"
