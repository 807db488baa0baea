"""How long work takes: several kinds of it in turns, so that a busy machine slows them alike."""

import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from statistics import median
from typing import NamedTuple, TypeVar

K = TypeVar("K", bound=Hashable)
Begin = Callable[[], Callable[[], object]]
"""Makes work ready, and returns what is timed."""
CALLS = 12
"""In a row on a GPU, so that launching is hidden behind the call before, as in a rollout."""
LEAST_SECONDS = 0.1
"""On a CPU calls are made in a row for so long: a core that has slept takes milliseconds to be as
fast as before, which in a rollout happens once."""


class Spread(NamedTuple):
    """What several repeats took."""

    least: float
    median: float
    most: float

    @classmethod
    def of(cls, times: Sequence[float]) -> "Spread":
        """The extremes and the middle."""
        return cls(min(times), median(times), max(times))


def in_turns(works: Mapping[K, Begin], device: str, repeats: int) -> dict[K, list[float]]:
    """Seconds that each kind of work took, `repeats` times."""
    times: dict[K, list[float]] = {name: [] for name in works}
    for _ in range(repeats):
        for name, begin in works.items():
            times[name].append(seconds(begin, device))
    return times


def seconds(begin: Begin, device: str) -> float:
    """Seconds of a call, the mean of some in a row; on a GPU by its own clock."""
    if device == "cpu":
        time.sleep(0.05)  # torch's threads spin for a while after their work, in others' way
        total, calls = 0.0, 0
        while total < LEAST_SECONDS:
            work = begin()
            start = time.perf_counter()
            work()
            total += time.perf_counter() - start
            calls += 1
        return total / calls
    import torch

    events = []
    for _ in range(CALLS):
        work = begin()
        start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        start.record()
        work()
        end.record()
        events.append((start, end))
    torch.cuda.synchronize()
    return sum(start.elapsed_time(end) for start, end in events) / 1e3 / CALLS
