"""Ranks that are threads of one program: the readable reference of `mpi.py`, and for tests."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from queue import Queue
from typing import Any, TypeVar

from vnca.core import AnyArray
from vnca.ranks import RankError, Ranks, Swap

T = TypeVar("T")
_ENDED = object()


class ThreadRanks(Ranks):
    """A rank whose messages lie in queues, one from each rank to each."""

    def __init__(self, rank: int, queues: list[list["Queue[Any]"]]) -> None:
        super().__init__()
        self.rank = self.local = rank
        self.size = self.beside = len(queues)
        self._queues = queues

    def every(self, value: Any) -> list[Any]:
        """See `Ranks.every`."""
        self._put(dict.fromkeys(range(self.size), value))
        return [self._take(rank) for rank in range(self.size)]

    def _swap(self, outgoing: Mapping[int, AnyArray], incoming: Mapping[int, AnyArray]) -> Swap:
        self._put({rank: array.copy() for rank, array in outgoing.items()})
        return _Arriving(self, incoming)

    def _put(self, values: Mapping[int, Any]) -> None:
        for rank, value in values.items():
            self._queues[self.rank][rank].put(value)

    def _take(self, rank: int) -> Any:
        value = self._queues[rank][self.rank].get()
        if value is _ENDED:
            raise RankError(f"rank {rank} has ended")
        return value

    def leave(self) -> None:
        """Tell all others that nothing more will come."""
        self._put(dict.fromkeys(range(self.size), _ENDED))


class _Arriving(Swap):
    def __init__(self, ranks: ThreadRanks, incoming: Mapping[int, AnyArray]) -> None:
        self._ranks, self._incoming = ranks, dict(incoming)

    def poll(self) -> None:
        """Nothing: it lies there already, or is waited for."""

    def wait(self) -> None:
        while self._incoming:
            rank, array = self._incoming.popitem()
            found = self._ranks._take(rank)
            assert (found.shape, found.dtype) == (array.shape, array.dtype), "another was sent"
            array[...] = found


def together(size: int, work: Callable[[Ranks], T]) -> list[T]:
    """What work comes to on each of some ranks, all at once.

    Raises:
        Exception: What the work of one of them raised first.
    """
    queues: list[list[Queue[Any]]] = [[Queue() for _ in range(size)] for _ in range(size)]

    def run(rank: int) -> T:
        ranks = ThreadRanks(rank, queues)
        try:
            return work(ranks)
        finally:
            ranks.leave()

    with ThreadPoolExecutor(max_workers=size) as pool:
        runs = [pool.submit(run, rank) for rank in range(size)]
    for each in runs:
        with suppress(RankError):
            each.result()
    return [each.result() for each in runs]
