"""What long work tells on the terminal, in words or as JSON, and how it is told to end."""

import io
import json
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stderr
from pathlib import Path
from typing import Any, TextIO, TypeVar

from vnca.cli.help import as_option
from vnca.core.errors import Terminated

T = TypeVar("T")
_ARGUMENT = re.compile(r"`([a-z_]+(?:\.\w+)*)`")

# A terminal line is redrawn; a log gets a line now and then.
_REDRAW_SECONDS = 0.2
_LOG_SECONDS = 15.0

_line_is_open = False


class _Notes(io.TextIOBase):
    """A stream each of whose lines becomes an event of another."""

    def __init__(self, stream: TextIO) -> None:
        self.stream, self._line = stream, ""

    def write(self, text: str, /) -> int:
        *lines, self._line = (self._line + text).split("\n")
        for line in filter(None, (line.strip() for line in lines)):
            self.add(event="note", text=line)
        return len(text)

    def add(self, **facts: Any) -> None:
        """Write an event."""
        print(json.dumps(facts), file=self.stream, flush=True)

    def end(self) -> None:
        """Tell of a last line that was not ended."""
        self.write("\n")

    def fileno(self) -> int:
        return self.stream.fileno()


_notes: _Notes | None = None
"""Where events go while they are wanted."""


@contextmanager
def json_events(*, wanted: bool) -> Iterator[None]:
    """Say on standard error what happens as JSON, an object a line, if that is wanted.

    Whatever else is written there becomes notes; docs/guide/automation.md lists the objects.
    """
    global _notes
    if not wanted:
        yield
        return
    before, _notes = _notes, _Notes(sys.stderr)
    try:
        with redirect_stderr(_notes):
            yield
            _notes.end()
    finally:
        _notes = before


def event(kind: str, **facts: Any) -> bool:
    """Tell programs that something happened; False if they do not listen."""
    if _notes is None:
        return False
    _notes.end()
    _notes.add(event=kind, **facts)
    return True


def made(what: str, path: Path) -> None:
    """Tell where a result is: `film: painted.mp4`."""
    if not event("result", what=what, path=str(path)):
        end_line()
        print(f"{what}: {path}", file=sys.stderr, flush=True)


def as_options(text: str) -> str:
    """What the library says of arguments, such as `view.size`, in the words of the command line."""
    return _ARGUMENT.sub(lambda found: as_option(found[1]), text)


def end_line() -> None:
    """End the progress line a terminal shows, if any, so that what is printed next stands alone."""
    global _line_is_open
    if _line_is_open:
        print(file=sys.stderr, flush=True)
    _line_is_open = False


class Progress:
    """A line on standard error that says how far work has come.

    Usable as a context manager, which ends the line.
    """

    def __init__(self, what: str, total: int, unit: str, *, already: int = 0) -> None:
        """Start the clock.

        Args:
            what: The work, as a present participle: "training".
            total: How many units there are.
            unit: What is counted, in the plural: "frames".
            already: How many were finished before, which tell nothing of how fast it goes.
        """
        self._what, self._total, self._unit, self._already = what, total, unit, already
        self._start = time.monotonic()
        self._drawn = -_LOG_SECONDS
        self._terminal = sys.stderr.isatty()

    def __enter__(self) -> "Progress":
        """Begin."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the line."""
        end_line()

    def show(self, done: int, note: str = "") -> None:
        """Say that `done` units are finished; `note` is added at the end of the line."""
        global _line_is_open
        now = time.monotonic()
        is_often = self._terminal or _notes is not None
        pause = _REDRAW_SECONDS if is_often else _LOG_SECONDS
        if now - self._drawn < pause and done < self._total:
            return
        self._drawn = now
        elapsed = now - self._start
        fresh = max(0, done - self._already)
        left = elapsed / fresh * (self._total - done) if fresh else 0.0
        rate = f"{fresh / elapsed:.2f} {self._unit}/s" if fresh and elapsed > 0 else ""
        if event(
            "progress",
            what=self._what.strip(","),
            done=done,
            total=self._total,
            unit=self._unit,
            seconds_left=round(left, 1) if fresh else None,
            note=note,
        ):
            return
        line = f"{self._what} {done}/{self._total} {self._unit}  {rate}  {clock(left)} left  {note}"
        if self._terminal:
            print(f"\r\x1b[K{line.rstrip()}", end="", file=sys.stderr, flush=True)
            _line_is_open = True
        else:
            print(line.rstrip(), file=sys.stderr, flush=True)


def tracked(items: Iterable[T], what: str, total: int, unit: str) -> Iterator[T]:
    """`items`, with their progress shown as each is finished."""
    with Progress(what, total, unit) as progress:
        for done, item in enumerate(items):
            yield item
            progress.show(done + 1)


def clock(seconds: float) -> str:
    """A time as `1:02:03`, or `2:03` if it is under an hour."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"


def say(line: str) -> None:
    """Tell the user something that is not the result: on standard error, on a line of its own."""
    end_line()
    print(as_options(line), file=sys.stderr, flush=True)


class Terminal:
    """A `Watch` that draws a line of progress on standard error."""

    def __init__(self, check: Callable[[], None] = lambda: None) -> None:
        """Draw nothing yet; `check` is called after each unit of work, and may raise."""
        self._check = check
        self._work: tuple[str, int] | None = None
        self._line: Progress | None = None

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """Draw how far the work has come, and the time that is left."""
        if self._line is None or self._work != (what, total):
            self._work = what, total
            self._line = Progress(what, total, unit, already=done)
        else:
            self._line.show(done, note)
        if done == total:
            end_line()
            self._line = None
        self._check()

    def note(self, line: str) -> None:
        """Print the line."""
        say(line)

    def made(self, what: str, path: Path) -> None:
        """Print where a result is."""
        made(what, path)


@contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM raises `Terminated` in the main thread wherever that is, as Ctrl-C does its own."""

    def terminate(*_: Any) -> None:
        raise Terminated

    with _handling(terminate):
        yield


@contextmanager
def finishing() -> Iterator[Callable[[], None]]:
    """SIGTERM waits for a piece of work: the function given is called where one is finished.

    It raises `Terminated` if there was a SIGTERM. A second SIGTERM does not wait for the work, only
    for a frame that is being written meanwhile.
    """
    is_asked = False

    def ask(*_: Any) -> None:
        nonlocal is_asked
        if is_asked:
            raise Terminated
        is_asked = True

    def stop_if_asked() -> None:
        if is_asked:
            raise Terminated

    with _handling(ask):
        yield stop_if_asked


@contextmanager
def _handling(handler: Callable[..., None]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # Signals are the main thread's.
        return
    before = signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
