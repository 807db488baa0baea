"""How long work tells how far it has come: the library prints nothing, whoever calls it may."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol, TypeVar

T = TypeVar("T")


class Watch(Protocol):
    """Is told what long work does, in the thread that does it.

    What a method raises ends the work. `Cancelled` ends it as Ctrl-C does: everything finished so
    far is kept, and the work can be resumed.
    """

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """Some of the work is done.

        The first call for a piece of work says how much of it was done before.

        Args:
            what: The work, as a present participle: "training".
            done: How many units are finished.
            total: How many units there are.
            unit: What is counted, in the plural: "frames".
            note: What else there is to tell, such as a loss.
        """

    def note(self, line: str) -> None:
        """Something that the user should know, in one line; arguments are in backquotes."""

    def made(self, what: str, path: Path) -> None:
        """A result is there, whole: what it is, as "film", and its file or folder."""


class Silent:
    """A `Watch` that tells nobody."""

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """Do nothing."""

    def note(self, line: str) -> None:
        """Do nothing."""

    def made(self, what: str, path: Path) -> None:
        """Do nothing."""


SILENT = Silent()


def tracked(
    items: Iterable[T], watch: Watch, what: str, total: int, unit: str, *, already: int = 0
) -> Iterator[T]:
    """`items`, each told to `watch` once the loop over them comes back for the next."""
    watch.progress(what, already, total, unit)
    for done, item in enumerate(items, already + 1):
        yield item
        watch.progress(what, done, total, unit)
