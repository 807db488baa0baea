"""Painting a sequence of files: when one of them is broken, and going on after an end."""

import hashlib
import json
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

from vnca.core import Box
from vnca.core.errors import (
    FileFormatError,
    GridError,
    OutputError,
    ShapeError,
    VncaError,
)
from vnca.core.field import Field
from vnca.core.files import existing_file, remove_file, remove_leftovers
from vnca.core.lattice import Lattice
from vnca.core.volume import length_of_cells, refined_transform
from vnca.io import SmokeFormat, open_source, read_smoke, write_painted
from vnca.io.provenance import Provenance, velocity_of
from vnca.io.sequence import Frame, FrameSequence
from vnca.io.smoke_format import up_axis_of
from vnca.io.vdb import VdbFile
from vnca.painting import Ready, Roll
from vnca.painting.behind import Bookmark, Writing, in_turn, one_behind
from vnca.painting.chunk import WHOLE, Chunk
from vnca.painting.finished import MARK, is_complete, require_unchanged
from vnca.painting.frames import VelocityCheck, read_ahead
from vnca.painting.read import Read, close
from vnca.painting.shown import Painting
from vnca.painting.unfinished import Source, Unfinished
from vnca.ranks import Alone, Ranks

OnError = Literal["stop", "skip", "hold"]
BROKEN = (FileFormatError, GridError, ShapeError)
"""What a frame is that cannot be read, or is another than it was a moment ago."""


@dataclass(frozen=True, eq=False)
class Painter:
    """Paints the files of a sequence, one after the other, so that it can go on after any end.

    A frame is written whole, then the state it left behind, every now and then: after an end
    at any moment, the frames since are painted again to the same bytes.

    Attributes:
        sequence: What to paint.
        out: Folder for the painted frames.
        roll: The rule, ready for the sequence.
        lattice: Whose cells all frames are painted on.
        smoke: How smoke is read.
        colour_grids: Names for the colour.
        on_error: With a broken frame: stop; leave it out; or paint the one before it again.
        conditions: What else must be the same for a painting to be gone on with: its bytes
            follow from these, the sequence, the rule and nothing else.
        tell: Is given lines for the user.
        refine: How many times as fine as the smoke's the grid of the painting is.
        facts: What else files tell of their painting, beside how opaque it is to be seen.
        chunk: Which of the frames are painted, and how they follow those before.
        ranks: Who shares the frames, by their tiles.
    """

    sequence: FrameSequence
    out: Path
    roll: Roll
    lattice: Lattice
    smoke: SmokeFormat
    colour_grids: Sequence[str]
    on_error: OnError
    conditions: Mapping[str, Any]
    tell: Callable[[str], None]
    refine: int = 1
    facts: Mapping[str, str | int | float] = field(default_factory=dict)
    chunk: Chunk = WHOLE
    ranks: Ranks = field(default_factory=Alone)
    _velocity: VelocityCheck = field(init=False)

    def __post_init__(self) -> None:
        check = VelocityCheck(self.roll.rule, self.smoke, self.tell)
        object.__setattr__(self, "_velocity", check)

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """Those that are painted."""
        return self.sequence[self.chunk.first : self.chunk.stop]

    @cached_property
    def _bookmark(self) -> Bookmark:
        return Bookmark(self.unfinished_path, self._save, self.ranks)

    @property
    def finished(self) -> int:
        """How many frames are finished, of those that are painted."""
        last = self._bookmark.last
        return 0 if last is None else max(0, len(last.sources) - self.chunk.first)

    @property
    def unfinished_path(self) -> Path:
        """Where the state is kept: named after the first frame, as several may share a folder."""
        return self.out / f".{self.frames[0].path.stem}.resume.safetensors"

    def target(self, frame: Frame) -> Path:
        """The file a frame is painted to."""
        return self.out / f"{frame.path.stem}.vdb"

    @cached_property
    def mark(self) -> str:
        """What painted files tell of the painting they are of: equal under equal conditions."""
        described = json.dumps(self.conditions, sort_keys=True)
        return hashlib.blake2b(described.encode(), digest_size=8).hexdigest()

    def begin(self, *, resume: bool, overwrite: bool) -> Unfinished:
        """Where to start: at the first frame, or where an earlier run ended.

        Args:
            resume: Start where an earlier run of this painting ended, if there was one.
            overwrite: Replace frames of others.

        Raises:
            OptionError: If it ended under other conditions.
            FileFormatError: If its state is damaged.
            OutputError: If the folder cannot be written, or holds frames that are not to be
                replaced.
        """
        path, first, left = self.unfinished_path, self.chunk.first, self.chunk.state_out
        if self.ranks.leads:
            names = {self.target(frame).name for frame in self.frames}
            remove_leftovers(self.out, names | {path.name})
        if path.exists() and resume:
            unfinished = self._loaded(path)
            require_unchanged(self, unfinished.sources)
            done = max(0, len(unfinished.sources) - first)
            self.tell(f"{self.out}: going on after {done} frames")
            return unfinished
        if resume and is_complete(self):
            self.tell(f"{self.out}: all {len(self.frames)} frames are painted already")
            if left is not None:
                return self._loaded(left, handed_over=True)
            sources = tuple(self._source(first + at) for at in range(len(self.frames)))
            return Unfinished(self.conditions, (None,) * first + sources, self._start())
        there = [target for target in map(self.target, self.frames) if target.exists()]
        if path.exists() and not overwrite:
            raise OutputError(
                f"{self.out}: holds a painting that was interrupted; go on with `resume`, or "
                "choose another `out` or `overwrite`"
            )
        if there and not overwrite:
            raise OutputError(
                f"{self.out}: holds painted frames already, such as {there[0].name}"
                f"{', and none to go on from' if resume else ''}; choose another `out` or "
                "`overwrite`"
            )
        if resume:
            self.tell(f"{self.out}: nothing unfinished there; starting with the first frame")
        handed_over = partial(self._loaded, handed_over=True)
        return self.chunk.start(self.sequence, self.conditions, self._start(), handed_over)

    def paint(self, unfinished: Unfinished) -> Generator[Path | None, None, None]:
        """Go on from there to the end of the sequence.

        Yields:
            The file of each frame, also of those already finished; None for one left out. Close
            the iterator to keep the state.

        Raises:
            VncaError: If a file cannot be written, or a broken frame is to stop the painting.
        """
        self._bookmark.last = unfinished
        done = unfinished.sources[self.chunk.first :]
        jobs = self._jobs(unfinished)
        # What ranks tell each other has an order, which threads do not keep.
        paths = one_behind(jobs) if self.ranks.size == 1 else in_turn(jobs)
        try:
            for frame, source in zip(self.frames, done, strict=False):
                yield self.target(frame) if source else None
            for frame, path in paths:
                if frame in self.frames:
                    yield path
            if self.chunk.state_out is not None:
                self._save(self._bookmark.last, self.chunk.state_out)
        finally:
            paths.close()
            jobs.close()
            self._bookmark.end()

    def _jobs(
        self, unfinished: Unfinished
    ) -> Generator[Callable[[], tuple[Frame, Path | None]], None, None]:
        """Paint the frames that are left: of each what remains to be done, the writing.

        Where a broken frame is not to stop the painting, it is done already: what the next one is
        painted from depends on it.
        """
        sources, state = list(unfinished.sources), unfinished.state
        start, stop = len(sources), self.chunk.first + len(self.frames)
        loads = (partial(self._read, at) for at in range(start, stop))
        reads = read_ahead(loads, unwanted=close)
        held = self._held(sources)
        try:
            for frame, read in zip(self.sequence[start:stop], reads, strict=True):
                try:
                    left = Unfinished(self.conditions, tuple(sources), state)
                    before = held
                    held, state, source, write = self._finish(frame, read, held, left)
                    sources.append(source)
                    after = Unfinished(self.conditions, tuple(sources), state)
                    path = self.target(frame) if source else None
                    unwanted = None if held is read else read
                    yield partial(self._bookmark.written, (frame, path), write, unwanted, after)
                except BaseException:
                    if held is not read:
                        close(read)
                    raise
                if held is not before:
                    close(before)
        finally:
            reads.close()
            close(held)

    def discard(self) -> None:
        """Forget the state: there is nothing to go on with."""
        if self.ranks.leads:
            remove_file(self.unfinished_path)

    def _finish(
        self, frame: Frame, read: Read | VncaError, held: Read | None, left: Unfinished
    ) -> tuple[Read | None, Any, Source | None, Writing | None]:
        """Paint a frame or do what is to be done if it is broken."""
        try:
            if isinstance(read, VncaError):
                raise read
            if self.on_error == "stop":
                state, write = self._painted(frame, read, left)
                return None, state, read.source, write
            state = self._painted_and_written(frame, read, left)
            return read if self.on_error == "hold" else None, state, read.source, None
        except BROKEN as error:
            if self.on_error == "stop":
                raise
            if self.on_error == "hold" and held is not None:
                self.tell(f"{error}; holding frame {held.frame.number} in its place")
                return held, self._painted_and_written(frame, held, left), held.source, None
            self.tell(f"{error}; leaving it out")
            if frame in self.frames:
                remove_file(self.target(frame))
            return held, left.state, None, None

    def _painted_and_written(self, frame: Frame, read: Read, left: Unfinished) -> Any:
        state, write = self._painted(frame, read, left)
        if write is not None:
            write()
        return state

    def _save(self, unfinished: Unfinished, path: Path) -> None:
        """Keep what is finished, and the state that it left."""
        unfinished.save(path)

    def _start(self) -> Any:
        """The state before the first frame."""
        return self.roll.start()

    def _loaded(self, path: Path, *, handed_over: bool = False) -> Unfinished:
        """What an earlier run left, or the chunk before this one."""
        return Unfinished.load(path, self.conditions, self.roll, handed_over=handed_over)

    def _begin_to_write(self, frame: Frame, read: Read, left: Unfinished) -> None:
        """Look whether the file of a frame may be written now, when it was painted."""
        read.require_unchanged()
        if frame == self.frames[0]:
            # From here on frames of an earlier painting are overwritten, and after an end at any
            # moment it is this one that can be gone on with.
            self._save(left, self.unfinished_path)

    def _painted(self, frame: Frame, read: Read, left: Unfinished) -> tuple[Any, Writing | None]:
        """The state after a frame, and what makes its file; nothing of one before the chunk."""
        self._velocity.look(read.smoke, read.frame.path)
        if frame not in self.frames:
            return self.roll.passed(read.take(), left.state), None
        state, shown = self.roll.stepped(read.take(), left.state)
        return state, partial(self._write, frame, read, left, shown)

    def _write(
        self, frame: Frame, read: Read, left: Unfinished, shown: Callable[[], Painting]
    ) -> None:
        """Make the file of a frame."""
        painting = shown()
        self._begin_to_write(frame, read, left)
        fields = painting.density_field, painting.colour_field, painting.emission
        told = self.provenance(read)
        self.write(self.target(frame), read, told, fields, painting.smoke.box)

    def write(
        self,
        path: Path,
        read: Read,
        provenance: Provenance,
        fields: tuple[Field, Field, Field | None],
        box: Box,
    ) -> None:
        """Write a painted frame as a whole.

        Args:
            path: To where.
            read: What it was painted from.
            provenance: What it tells of its painting.
            fields: Density, colour and light.
            box: Their cells.

        Raises:
            OutputError: If it cannot be written.
        """
        density, colour, emission = fields
        write_painted(
            path,
            read.frame.path,
            self.smoke,
            density=density,
            colour=colour,
            box=box,
            lattice=self.lattice,
            colour_grids=self.colour_grids,
            refine=self.refine,
            provenance=provenance,
            file=read.file,
            emission=emission,
            beyond=self.roll.beyond,
        )

    def provenance(self, read: Read) -> Provenance:
        """What the painting of a frame tells of itself."""
        scales, grid = self.roll.rule.scales, self.roll.grid
        cells = self.lattice.to_world
        if grid > 1:
            cells = refined_transform(cells, grid)
        return Provenance(
            scales.extinction(length_of_cells(cells)),
            scales.gamma * grid,
            up_axis_of(read.frame.path, self.smoke),
            {**self.facts, MARK: self.mark},
            velocity_of(self.smoke),
        )

    def _read(self, at: int) -> Read | VncaError:
        """A frame of the sequence, or what is wrong with it."""
        frame = self.sequence[at]
        with ExitStack() as opened:
            try:
                source = self._source(at)
                file = open_source(frame.path)
                if file is not None:
                    opened.enter_context(file)
                smoke = self._opened(frame, file)
                box = smoke.box.refined(self.roll.grid)
                if self.roll.box.union(box) != self.roll.box:
                    return GridError(
                        f"{frame.path}: has changed since the start and now has smoke beyond the "
                        "box of the sequence; start anew"
                    )
                smoke, ready = self._made_ready(smoke)
            except BROKEN as error:
                return error
            except OSError as error:
                return FileFormatError(f"{frame.path}: cannot be read ({error.strerror})")
            opened.pop_all()  # it is closed once the frame is painted
            return Read(source, frame, smoke, file, ready)

    def _opened(self, frame: Frame, file: VdbFile | None) -> Any:
        """The smoke of a frame."""
        return read_smoke(
            frame.path, self.smoke, frame=frame.number, lattice=self.lattice, file=file
        )

    def _made_ready(self, smoke: Any) -> tuple[Any, Ready | None]:
        """The same as fine as it is painted, and what painting takes of it beforehand."""
        smoke = smoke.refined(self.roll.grid)
        return smoke, self.roll.ready(smoke)

    def _source(self, at: int) -> Source:
        """What a frame of the sequence is painted from, as it is now."""
        status = existing_file(self.sequence[at].path).stat()
        return Source(at, status.st_size, status.st_mtime_ns)

    def _held(self, sources: Sequence[Source | None]) -> Read | None:
        """The last frame that was not broken, where it may be wanted again."""
        last = next((source for source in reversed(sources) if source), None)
        if self.on_error != "hold" or last is None:
            return None
        read = self._read(last.frame)
        if isinstance(read, VncaError):
            raise read
        return read
