"""Writing a frame beside the painting of the next, and keeping how far a painting has come."""

import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from vnca.core.errors import OutputError, VncaError
from vnca.painting.read import Read, close
from vnca.painting.unfinished import Unfinished
from vnca.ranks import Ranks

T = TypeVar("T")
Writing = Callable[[], None]
"""Makes the file of a painted frame."""
_SAVING_SHARE = 0.02
"""Share of the time that may go into keeping the state."""


def one_behind(jobs: Iterator[Callable[[], T]]) -> Generator[T, None, None]:
    """The results of `jobs` in order, each done in a thread while the next job is made.

    What a job raises, or making one, is raised after the results before it. A job that has begun is
    ended before the generator is.
    """
    with ThreadPoolExecutor(max_workers=1) as writer:
        pending: Future[T] | None = None
        while True:
            failure, job = None, None
            try:
                job = next(jobs, None)
            except BaseException as error:  # what is finished is told of even as the user ends it
                failure = error
            before, pending = pending, None
            results = [] if before is None else [before.result()]
            if job is not None:
                pending = writer.submit(job)
            yield from results
            if failure is not None:
                raise failure
            if job is None:
                return


def in_turn(jobs: Iterator[Callable[[], T]]) -> Generator[T, None, None]:
    """As `one_behind`, each job done before the next is made."""
    for job in jobs:
        yield job()


@dataclass(eq=False)
class Bookmark:
    """Keeps how far a painting has come in a file, now and then.

    Attributes:
        path: The file.
        save: Writes it.
        ranks: Who keep it together.
        last: As the last finished frame left it; None before painting begins.
    """

    path: Path
    save: Callable[[Unfinished, Path], None]
    ranks: Ranks
    last: Unfinished | None = None
    _saved: bool = field(default=True, init=False)
    _due: float = field(default=0.0, init=False)

    def written(
        self, result: T, write: Writing | None, read: Read | VncaError | None, left: Unfinished
    ) -> T:
        """A result, once a frame is finished.

        Args:
            result: What it is.
            write: Makes the file, if that is not done.
            read: What it was painted from, to be closed.
            left: How far the painting has come with it.

        Raises:
            VncaError: If a file cannot be written.
        """
        try:
            if write is not None:
                write()
        finally:
            close(read)
        self._keep(left)
        return result

    def _keep(self, unfinished: Unfinished) -> None:
        self.last, self._saved = unfinished, False
        begun = time.monotonic()
        if self.ranks.every(begun >= self._due)[0]:
            self._save()
            ended = time.monotonic()
            self._due = ended + (ended - begun) / _SAVING_SHARE

    def end(self) -> None:
        """Nothing more will be finished: keep what was, if there is room for it."""
        # Of several ranks, the others may not be there any more.
        if not self._saved and self.ranks.size == 1:
            with suppress(OutputError):
                self._save()

    def _save(self) -> None:
        assert self.last is not None, "nothing can be unsaved before"
        self.save(self.last, self.path)
        self._saved = True
