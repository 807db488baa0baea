"""What long work tells, on the terminal."""

from collections.abc import Callable
from pathlib import Path

from vnca.cli.options import say
from vnca.cli.progress import Progress, end_line, made


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


TERMINAL = Terminal()
