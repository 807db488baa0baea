"""Sequences of frames: which files a pattern, a folder and a range of frames mean.

A frame number is a whole number. Patterns with a number (`smoke_%04d.vdb`, `smoke.$F4.vdb`,
`smoke_####.vdb`, `smoke_%d.vdb`, `smoke.$F.vdb`) and globs (`*`, `?`) stand for the name of a file;
folders are taken as written.

A dash before the digits is a minus at the start of a name and after `.`, `_`, a space or another
dash (`smoke.-0001`, `smoke--0001`). After anything else it is a separator, as in `smoke-0001`,
unless a pattern leaves it to the number (`smoke%04d.vdb`) and finds frame 0 as well.

`smoke.10.25` beside `smoke.10` is a sub-frame, a quarter of a frame after it; so it is without that
file, beside `smoke.10.5` and `smoke.10.75`. Sub-frames are told of and left out: a rule is taught
its steps for whole frames, and velocity is in cells per frame.
"""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import translate
from itertools import chain
from pathlib import Path
from typing import NamedTuple, overload

from vnca.core.errors import OptionError, SequenceError
from vnca.io.smoke_format import suffixes

MAX_FRAMES = 1_000_000
_NUMBER = re.compile(r"%0?(?P<printf>\d*)d|\$F(?P<houdini>\d*)|(?P<hashes>#+)")
_SUB_FRAME_TOKEN = "$FF"
_IN_A_ROW = "number them all in a row (docs/guide/stylize.md)"  # What else sub-frames can be.
_BEFORE_MINUS = "._- "
_TRAILING = re.compile(rf"((?<![^{re.escape(_BEFORE_MINUS)}])-)?\d{{1,18}}\Z", re.ASCII)
_RANGE = re.compile(r"\s*(-?\d{1,18})(?:\s*-\s*(-?\d{1,18})(?:\s*x\s*(\d{1,18}))?)?\s*", re.ASCII)


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
        sub_frames: Files between the frames that are left out.
    """

    frames: tuple[Frame, ...]
    gaps: tuple[int, ...] = ()
    sub_frames: tuple[Path, ...] = ()

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Frame, ...]: ...
    def __getitem__(self, index: int | slice) -> Frame | tuple[Frame, ...]:
        return self.frames[index]

    def __len__(self) -> int:
        return len(self.frames)


class _Found(NamedTuple):
    """Files of one name that differ in their number."""

    frames: list[Frame]
    sub_frames: list[Path]


def find_frames(pattern: str | Path, frames: str | None = None) -> FrameSequence:
    """The frames a pattern selects, by number.

    A link to a file that is not there counts: it says that a frame is missing.

    Args:
        pattern: A file; a folder with one numbered sequence of `.vdb` or `.npz` files, or in
            Mantaflow's layout (`d/` and `v/`); a name with a frame number; or a glob over names
            that end in a number. A single file without a number is frame 0.
        frames: Which numbers to take, see `parse_frames`; by default all.

    Raises:
        SequenceError: If nothing is found, several sequences match, one number has two files, or
            there are sub-frames and neither the pattern nor `frames` asks for whole ones.
        OptionError: If `frames` cannot be read.
    """
    wanted = None if frames is None else parse_frames(frames)
    path = Path(pattern).expanduser()
    if path.is_file() or (path.is_symlink() and not path.exists()):
        found = _Found([Frame(_trailing_number(path) or 0, path)], [])
    elif path.is_dir():
        found = _one_sequence(path, _folder_sequences(path), wanted)
    elif _SUB_FRAME_TOKEN in path.name:
        raise SequenceError(
            f"{path}: {_SUB_FRAME_TOKEN} names sub-frames, which cannot be used; "
            "$F names whole frames"
        )
    elif _NUMBER.search(path.name):
        found = _matching_number(path)
    elif any(sign in path.name for sign in "*?["):
        matches = re.compile(translate(path.name)).match
        found = _one_sequence(path, _sequences(p for p in _files(path) if matches(p.name)), wanted)
    else:
        raise SequenceError(f"{path}: no such file or folder{_beside(path)}")
    return _selected(path, found, wanted)


def frames_beside(file: Path) -> list[Frame]:
    """The frames, by number, of the sequence in its folder that a file belongs to; or none."""
    for found in _sequences(_files(file)).values():
        if any(frame.path == file for frame in found.frames):
            return sorted(found.frames)
    return []


def parse_frames(text: str) -> tuple[int, ...]:
    """Frame numbers written as `30-53`, `30-53x2` (every second), `1,4,7-9` or `-5--2`, sorted.

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


def _selected(path: Path, found: _Found, wanted: tuple[int, ...] | None) -> FrameSequence:
    by_number: dict[int, Frame] = {}
    for frame in sorted(found.frames):
        other = by_number.setdefault(frame.number, frame)
        if other is not frame:
            raise SequenceError(
                f"{path}: frame {frame.number} has two files, "
                f"{other.path.name} and {frame.path.name}"
            )
    if wanted is None:
        first, last = min(by_number), max(by_number)
        if last - first > MAX_FRAMES:
            raise SequenceError(
                f"{path}: frame numbers run from {first} to {last}; choose some with `frames`"
            )
        wanted = tuple(range(first, last + 1))
    chosen = tuple(by_number[number] for number in wanted if number in by_number)
    if not chosen:
        raise SequenceError(
            f"{path}: no frame of {format_frames(wanted)}; there are {format_frames(by_number)}"
        )
    gaps = tuple(number for number in wanted if number not in by_number)
    return FrameSequence(chosen, gaps, tuple(found.sub_frames))


def _matching_number(path: Path) -> _Found:
    """Files whose name is `path.name` with a number in place of its token."""
    if len(_NUMBER.findall(path.name)) > 1:
        raise SequenceError(f"{path}: expected one frame number in the name, found several")
    token = _NUMBER.search(path.name)
    assert token is not None
    digits = int(token["printf"] or token["houdini"] or len(token["hashes"] or "#"))
    before, after = path.name[: token.start()], path.name[token.end() :]
    # For %04d, printf makes -001 of -1; for $F4, Houdini makes -0001.
    number = rf"(\d{{{digits},18}}|-\d{{{max(1, digits - 1)},18}})"
    name = re.compile(f"{re.escape(before)}{number}{re.escape(after)}", re.ASCII)
    files = _files(path)
    matches = [(match[1], file) for file in files if (match := name.fullmatch(file.name))]
    if not _is_minus_after(before, [written for written, _ in matches]):
        matches = [(written, file) for written, file in matches if not written.startswith("-")]
    if not matches:
        raise SequenceError(f"{path}: no file matches{_beside(path)}")
    chosen, sub_frames = {file for _, file in matches}, []
    for found in _sequences(files).values():
        if not chosen.isdisjoint(found.sub_frames):
            raise _no_sub_frames(path, found.sub_frames)
        if not chosen.isdisjoint(frame.path for frame in found.frames):
            sub_frames = found.sub_frames
    return _Found([Frame(int(written), file) for written, file in matches], sub_frames)


def _is_minus_after(before: str, written: Sequence[str]) -> bool:
    """Whether a dash between `before` and digits is a minus, where these numbers are written."""
    if before == "" or before[-1] in _BEFORE_MINUS:
        return True
    zeros = [number for number in written if int(number) == 0]
    return bool(zeros) and not any(number.startswith("-") for number in zeros)


def _folder_sequences(folder: Path) -> dict[str, _Found]:
    """Sequences in a folder; Mantaflow's `d/` counts as one where nothing else is there."""
    files = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in suffixes()]
    sequences = _sequences(files)
    if not sequences and (folder / "d").is_dir():
        sequences = _sequences(sorted((folder / "d").glob("*.npz")))
    return sequences


def _sequences(files: Iterable[Path]) -> dict[str, _Found]:
    """Numbered files, grouped by what they share, under the pattern that selects them.

    Hidden files are none: a program that was killed leaves such.
    """
    groups: dict[tuple[str, str], list[Frame]] = {}
    for file in files:
        number = _trailing_number(file)
        if number is not None and not file.name.startswith(".") and not file.is_dir():
            prefix = _TRAILING.sub("", file.stem)
            groups.setdefault((prefix, file.suffix), []).append(Frame(number, file))
    shots: dict[tuple[str, str], dict[str, list[Frame]]] = {}
    for (prefix, suffix), members in groups.items():
        if (whole := _before_two_numbers(prefix)) is not None:
            shots.setdefault((whole, suffix), {})[prefix] = members
    sub_frames: dict[tuple[str, str], list[Path]] = {}
    for (whole, suffix), parts in shots.items():
        for prefix in _sub_frame_prefixes(parts):
            del groups[prefix, suffix]
            paths = [frame.path for frame in parts[prefix]]
            sub_frames.setdefault((whole, suffix), []).extend(paths)
    found: dict[str, _Found] = {}
    for prefix, suffix in groups | sub_frames:
        frames = groups.get((prefix, suffix), [])
        name = f"{prefix}{_token(prefix, frames)}{suffix}"
        found[name] = _Found(frames, sub_frames.get((prefix, suffix), []))
    return found


def _before_two_numbers(prefix: str) -> str | None:
    """`smoke.` of `smoke.10.`, behind which there is a number; None if there is only that one."""
    match = _TRAILING.search(prefix[:-1]) if prefix.endswith(".") else None
    return prefix[: match.start()] if match else None


def _sub_frame_prefixes(parts: dict[str, list[Frame]]) -> list[str]:
    """Which of `smoke.10.`, `smoke.11.` and so on, with the files of each, begin sub-frames."""
    digits = {
        prefix: [frame.path.stem[len(prefix) :] for frame in members]
        for prefix, members in parts.items()
    }
    besides = [
        prefix
        for prefix, (first, *_) in parts.items()
        if first.path.with_name(f"{prefix[:-1]}{first.path.suffix}").exists()
    ]
    found = [prefix for prefix in besides if _are_fractions(digits[prefix])]
    if found or _divide_frames(list(digits.values())):
        found += [prefix for prefix in parts if prefix not in besides]
    return found


def _are_fractions(digits: list[str]) -> bool:
    """Whether what is written after `smoke.10.` are fractions, where `smoke.10` is a frame itself.

    Else they are frames of a shot: where they are padded as frames are (`0001`), or run on as no
    fraction is written (`9`, `10`).
    """
    if not all(map(str.isdigit, digits)):
        return False
    if len(set(map(len, digits))) == 1:
        return not any(number.startswith("0") for number in digits)
    return not any(number.endswith("0") for number in digits)


def _divide_frames(shots: list[list[str]]) -> bool:
    """Whether what is written after `smoke.10.`, `smoke.11.` and so on are fractions.

    Where there is no frame `smoke.10`, they are if together they divide a frame into equal parts
    (`25`, `5`, `75`), with or without zero; but not if they could as well be frames in a row.
    """
    written = set().union(*shots)
    if not all(map(str.isdigit, written)):
        return False
    numbers = sorted(map(int, written))
    if (len(shots) == 1 or len(numbers) > 1) and numbers == [*range(numbers[0], numbers[-1] + 1)]:
        return False
    fractions = sorted((int(digits) / 10 ** len(digits), len(digits)) for digits in written)
    skipped = int(fractions[0][0] > 0)
    parts = len(fractions) + skipped
    return parts > 1 and all(
        abs(fraction - at / parts) <= 10.0**-places
        for at, (fraction, places) in enumerate(fractions, skipped)
    )


def _token(prefix: str, members: list[Frame]) -> str:
    digits = [frame.path.stem[len(prefix) :].removeprefix("-") for frame in members]
    padded = any(d.startswith("0") and len(d) > 1 for d in digits)
    return f"%0{min(map(len, digits))}d" if padded else "%d"


def _one_sequence(
    path: Path, sequences: dict[str, _Found], wanted: tuple[int, ...] | None
) -> _Found:
    if not sequences:
        raise SequenceError(f"{path}: no numbered .vdb or .npz file{_beside(path)}")
    if len(sequences) > 1:
        shots = {_before_two_numbers(pattern[: pattern.rindex("%")]) for pattern in sequences}
        is_doubtful = len(shots) == 1 and None not in shots
        also = f"; if these are sub-frames, {_IN_A_ROW}" * is_doubtful
        raise SequenceError(
            f"{path}: several sequences; choose one of {', '.join(sorted(sequences))}{also}"
        )
    ((pattern, found),) = sequences.items()
    if found.sub_frames and (wanted is None or not found.frames):
        raise _no_sub_frames(path, found.sub_frames, _whole_frames(path, pattern, found.frames))
    return found


def _whole_frames(path: Path, pattern: str, found: list[Frame]) -> str:
    """How whole frames are chosen, those found or those that the pattern finds."""
    if found:
        whole = format_frames(frame.number for frame in found)
        return f"choose whole frames with `frames` {whole}, or "
    folder = path if path.is_dir() else path.parent
    with suppress(SequenceError):
        _matching_number(folder / pattern)
        return f"choose whole frames with {pattern}, or "
    return ""


def _no_sub_frames(path: Path, files: list[Path], instead: str = "") -> SequenceError:
    more = f" and {len(files) - 1} more" if len(files) > 1 else ""
    return SequenceError(
        f"{path}: {files[0].name}{more} are sub-frames, and only whole frames can be used; "
        f"{instead}{_IN_A_ROW}"
    )


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
