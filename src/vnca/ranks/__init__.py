"""Programs that do one piece of work together, each a rank, and what they tell each other.

All of them run the same code on the same files. Whatever is written here is called by all ranks in
the same order.
"""

import os
import pickle  # nosec B403
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import BackendUnavailableError, VncaError

_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "PALS_LOCAL_SIZE")
"""What launchers of MPI tell a program: among how many it was started, here or in all."""


_NO_MORE = object()


class RankError(VncaError):
    """Another rank has come to an end."""


class Swap(ABC):
    """Arrays on their way between ranks."""

    @abstractmethod
    def poll(self) -> None:
        """Go on with it; to be called now and then between pieces of other work."""

    @abstractmethod
    def wait(self) -> None:
        """Come to its end: what comes in is there.

        Raises:
            RankError: If a rank ended before.
        """


@dataclass
class Sent:
    """What a rank has sent.

    Attributes:
        messages: How many arrays.
        bytes: How much they hold.
    """

    messages: int = 0
    bytes: int = 0


class Ranks(ABC):
    """What a rank knows of itself, and how it reaches the others.

    Attributes:
        rank: Its number.
        size: How many there are.
        local: Its number among those on the same machine.
        beside: How many are on that machine.
        sent: What it has sent by `swap`.
    """

    rank = 0
    size = 1
    local = 0
    beside = 1

    def __init__(self) -> None:
        self.sent = Sent()

    @property
    def leads(self) -> bool:
        """Whether it is the first, which alone writes and tells."""
        return self.rank == 0

    @property
    def others(self) -> list[int]:
        """All but itself."""
        return [rank for rank in range(self.size) if rank != self.rank]

    @abstractmethod
    def every(self, value: Any) -> list[Any]:
        """What each rank gives here, by its number; small values, as they are pickled.

        Raises:
            RankError: If a rank ended before.
        """

    def swap(self, outgoing: Mapping[int, AnyArray], incoming: Mapping[int, AnyArray]) -> Swap:
        """Begin to send arrays to ranks, and to fill arrays from ranks.

        Args:
            outgoing: To whom what is sent; it must stay as it is to the end.
            incoming: From whom what is filled, of the shape and type that is sent there.
        """
        self.sent.messages += len(outgoing)
        self.sent.bytes += sum(array.nbytes for array in outgoing.values())
        return self._swap(outgoing, incoming)

    @abstractmethod
    def _swap(self, outgoing: Mapping[int, AnyArray], incoming: Mapping[int, AnyArray]) -> Swap:
        """See `swap`."""

    def gather(self, values: Iterable[Any], take: Callable[[Any], None]) -> None:
        """Give values to the first rank, one at a time, whose `take` is called with each.

        Raises:
            RankError: If a rank ended before.
        """
        left = iter(() if self.leads else values)
        while True:
            mine = next(left, _NO_MORE)
            data = b"" if mine is _NO_MORE else pickle.dumps(mine)
            sizes = self.every(len(data))
            if not any(sizes):
                return
            coming = {
                rank: np.empty(size, np.uint8)
                for rank, size in enumerate(sizes)
                if size and self.leads
            }
            going = {0: np.frombuffer(data, np.uint8)} if data else {}
            self.swap(going, coming).wait()
            for rank in sorted(coming):
                take(pickle.loads(coming[rank].data))  # of this very program  # nosec B301

    def give_up(self, line: str) -> None:
        """Leave it to the first rank to tell why this one ends, and to end all.

        Comes back where this is the first.
        """
        return

    def end(self, code: int) -> None:
        """End all ranks with a code, as this one has failed.

        Comes back where there are no others.
        """
        return


class _Nothing(Swap):
    def poll(self) -> None:
        pass

    def wait(self) -> None:
        pass


class Alone(Ranks):
    """A program by itself."""

    def every(self, value: Any) -> list[Any]:
        """See `Ranks.every`."""
        return [value]

    def _swap(self, outgoing: Mapping[int, AnyArray], incoming: Mapping[int, AnyArray]) -> Swap:
        return _Nothing()


def give_up(line: str) -> None:
    """See `Ranks.give_up`, of those that were launched; `line` is what the user is to be told."""
    with suppress(BackendUnavailableError):
        launched().give_up(line)


def ended(code: int) -> int:
    """The code with which a program ends, by itself; after a failure, all ranks with it."""
    with suppress(BackendUnavailableError):
        if code:
            launched().end(code)
    return code


@cache
def launched() -> Ranks:
    """The ranks among which this program was started, as by `mpirun`.

    Raises:
        BackendUnavailableError: If it was, and MPI cannot be used.
    """
    started = [int(os.environ[name]) for name in _SIZES if os.environ.get(name, "").isdigit()]
    if max(started, default=1) == 1:
        return Alone()
    try:
        from vnca.ranks.mpi import MpiRanks
    except (ImportError, RuntimeError) as error:
        raise BackendUnavailableError(
            f"started by mpirun, which needs mpi4py: pip install 'vnca[mpi]' ({error})"
        ) from error
    return MpiRanks()
