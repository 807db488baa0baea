"""Ranks that are programs started by `mpirun`, by mpi4py.

Whoever waits looks now and then, and sleeps between: where ranks share cores, one that waits leaves
them to one that works; signals are heard, and so is the end of another rank.
"""

import os
import pickle  # nosec B403
import sys
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np
from mpi4py import MPI

from vnca.core import AnyArray
from vnca.ranks import RankError, Ranks, Swap

_SIGNAL = 128
_SHORTEST, _LONGEST = 2e-5, 2e-3
_PATIENCE = 600.0
"""Seconds for which a rank that failed waits to be ended by the first."""


class MpiRanks(Ranks):
    """The programs of MPI's world."""

    def __init__(self) -> None:
        super().__init__()
        self._data, self._failures = MPI.COMM_WORLD.Dup(), MPI.COMM_WORLD.Dup()
        self.rank, self.size = self._data.rank, self._data.size
        machine = self._data.Split_type(MPI.COMM_TYPE_SHARED)
        self.local, self.beside = machine.rank, machine.size
        sys.excepthook = _abort

    def every(self, value: Any) -> list[Any]:
        """See `Ranks.every`."""
        mine = np.frombuffer(pickle.dumps(value), np.uint8)
        sizes = np.empty(self.size, np.int64)
        self.finish(self._data.Iallgather(np.array([len(mine)]), sizes))
        whole = np.empty(sizes.sum(), np.uint8)
        ends = np.cumsum(sizes)
        starts = ends - sizes
        target: Any = [whole, sizes.tolist(), starts.tolist(), MPI.BYTE]
        self.finish(self._data.Iallgatherv([mine, MPI.BYTE], target))
        ranges = zip(starts.tolist(), ends.tolist(), strict=True)
        # Nobody but ranks of this very program sends here.
        return [pickle.loads(whole[start:end].data) for start, end in ranges]  # nosec B301

    def _swap(self, outgoing: Mapping[int, AnyArray], incoming: Mapping[int, AnyArray]) -> Swap:
        held = {rank: np.ascontiguousarray(array) for rank, array in outgoing.items()}
        requests = [self._data.Irecv(_bytes(array), rank) for rank, array in incoming.items()]
        requests += [self._data.Isend(_bytes(array), rank) for rank, array in held.items()]
        return _Underway(self, requests, held)

    def finish(self, *requests: Any) -> None:
        """Wait for requests.

        Raises:
            RankError: If a rank failed.
        """
        pause, left = _SHORTEST, list(requests)
        while left:
            left = [request for request in left if not request.Test()]
            if not left:
                return
            self._hear()
            time.sleep(pause)
            pause = min(_LONGEST, 2 * pause)

    def _hear(self) -> None:
        if self.leads and self._failures.iprobe():
            raise RankError(self._failures.recv())

    def give_up(self, line: str) -> None:
        """See `Ranks.give_up`."""
        if self.leads:
            return
        told = self._failures.isend(line, 0)
        ended = time.monotonic() + _PATIENCE
        while time.monotonic() < ended:
            told.Test()  # messages are moved on by calls alone
            time.sleep(_LONGEST)

    def end(self, code: int) -> None:
        """See `Ranks.end`."""
        sys.stdout.flush()
        sys.stderr.flush()
        if code > _SIGNAL:
            os._exit(code)  # told to end by who ends them all
        self._data.Abort(code)


def _bytes(array: AnyArray) -> Any:
    return [array.reshape(-1).view(np.uint8), MPI.BYTE]


class _Underway(Swap):
    def __init__(self, ranks: MpiRanks, requests: list[Any], held: Mapping[int, AnyArray]) -> None:
        self._ranks, self._requests, self._held = ranks, requests, held

    def poll(self) -> None:
        self._requests = [request for request in self._requests if not request.Test()]

    def wait(self) -> None:
        self._ranks.finish(*self._requests)
        self._requests = []


def _abort(kind: type[BaseException], fault: BaseException, trace: TracebackType | None) -> None:
    """A fault of one rank ends all of them, or the others would wait for ever."""
    sys.__excepthook__(kind, fault, trace)
    sys.stderr.flush()
    MPI.COMM_WORLD.Abort(1)
