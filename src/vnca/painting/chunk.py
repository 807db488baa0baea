"""Chunks of a sequence: some of its frames painted apart, as they are in the painting of them all.

A frame needs what the one before it left. That is handed over in a file; or the frames before the
chunk are stepped through and not painted, the pre-roll, so that chunks need not wait for each
other. Both are exact. A pre-roll of fewer frames is not: docs/guide/farm.md says how far.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vnca.core.errors import OptionError, SequenceError
from vnca.io.sequence import FrameSequence, parse_frames
from vnca.painting.unfinished import Unfinished


@dataclass(frozen=True)
class Chunking:
    """Which of the frames of a painting are painted, and how they follow those before."""

    chunk: str | None = None
    """Paint only these of the frames, such as 9-16, as in the painting of all: parts of it that
    several machines paint."""
    state_in: Path | None = None
    """What painting the frames before the chunk left (`state_out`): goes on from there, exactly."""
    state_out: Path | None = None
    """Write here what the last frame leaves to the next, for `state_in` of the next chunk."""
    preroll: int | None = None
    """Without `state_in`: how many frames before the chunk are stepped through first. All of them,
    which is exact, unless given; after fewer a seam can be seen."""

    def __post_init__(self) -> None:
        if self.chunk is None:
            for name in ("state_in", "preroll"):
                if getattr(self, name) is not None:
                    raise OptionError(f"`{name}`: begins a chunk; name its frames with `chunk`")
        else:
            parse_frames(self.chunk)
        if self.state_in is not None and self.preroll is not None:
            raise OptionError("`state_in`, `preroll`: one of them, not both")
        if self.preroll is not None and self.preroll < 0:
            raise OptionError(f"`preroll` {self.preroll}: must not be negative")
        if self.state_out is not None and self.state_in == self.state_out:
            raise OptionError("`state_in`, `state_out`: two files are needed")


@dataclass(frozen=True)
class Chunk:
    """Frames of a sequence, one after the other.

    Attributes:
        first: Which one is the first, counted from 0.
        stop: The one after the last; None to the end.
        begin: The first of those that are stepped through, if none is handed over.
        state_in: What the frames before left.
        state_out: Where to write what its last leaves.
    """

    first: int = 0
    stop: int | None = None
    begin: int = 0
    state_in: Path | None = None
    state_out: Path | None = None

    @classmethod
    def of(cls, sequence: FrameSequence, asked: Chunking) -> "Chunk":
        """The one that is asked for.

        Raises:
            SequenceError: If its frames are not in the sequence, or not one after the other.
        """
        if asked.chunk is None:
            return cls(state_out=asked.state_out)
        numbers = set(parse_frames(asked.chunk))
        places = [at for at, frame in enumerate(sequence) if frame.number in numbers]
        if not places:
            raise SequenceError(
                f"`chunk` {asked.chunk}: none of these frames is in the sequence, "
                f"{sequence[0].number} to {sequence[-1].number}"
            )
        first, stop = places[0], places[-1] + 1
        if len(places) < stop - first:
            between = next(at for at in range(first, stop) if at not in places)
            raise SequenceError(
                f"`chunk` {asked.chunk}: frame {sequence[between].number} lies between these; "
                "a chunk is frames one after the other"
            )
        begin = 0 if asked.preroll is None else max(0, first - asked.preroll)
        if asked.state_in is not None:
            begin = first
        return cls(first, stop, begin, asked.state_in, asked.state_out)

    def start(
        self,
        sequence: FrameSequence,
        conditions: Mapping[str, Any],
        start: Any,
        handed_over: Callable[[Path], Unfinished],
    ) -> Unfinished:
        """What it begins with: what was handed over, or nothing before its pre-roll.

        Args:
            sequence: All frames.
            conditions: What the bytes of a frame follow from.
            start: The state before the first frame.
            handed_over: Reads what a chunk left.

        Raises:
            OptionError: If another painting handed it over, or another chunk of it.
            FileFormatError: If that file is missing or damaged.
        """
        if self.state_in is None:
            return Unfinished(conditions, (None,) * self.begin, start)
        before = handed_over(self.state_in)
        if (count := len(before.sources)) != self.first:
            follows = sequence[count].number if count < len(sequence) else "none"
            raise OptionError(
                f"{self.state_in}: goes on with frame {follows}, and the chunk begins with frame "
                f"{sequence[self.first].number}; name another as `state_in`"
            )
        return before

    def conditions(self, sequence: FrameSequence) -> dict[str, Any]:
        """What the bytes of the chunk follow from, where they are not those of a whole painting."""
        if self.state_in is not None or self.begin == 0:
            return {}
        ends = sequence[self.begin].number, sequence[self.first].number
        return {"`preroll`": list(ends)}


WHOLE = Chunk()
"""All of a sequence."""
