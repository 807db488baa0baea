"""How work is measured and written down: time in turns, peak memory, and on what machine.

Several kinds of work take turns, so that a busy machine slows them alike. Backends that do not
compute the same are not timed at all.
"""

import csv
import ctypes
import io
import json
import platform
import time
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, TypeVar

import vnca
from vnca.core.errors import DisagreementError, FileFormatError
from vnca.core.files import existing_file, whole_file

K = TypeVar("K", bound=Hashable)
Begin = Callable[[], Callable[[], object]]
"""Makes work ready, and returns what is timed."""
CALLS = 12
"""In a row on a GPU, so that launching is hidden behind the call before, as in a rollout."""
LEAST_SECONDS = 0.1
"""On a CPU calls are made in a row for so long: a core that has slept takes milliseconds to be as
fast as before, which in a rollout happens once."""
_SELF = Path("/proc/self")
Row = Mapping[str, Any]


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


def peak_mb(work: Callable[[], object], device: str) -> float | None:
    """Megabytes (10⁶ bytes) that a call of `work` takes; None where that cannot be known.

    On a GPU torch's allocator tells. On the CPU it is how far the resident memory of the process
    rises, as Linux records it, once all that earlier work left unused has been given back.
    """
    if device == "cpu":
        return _peak_on_cpu(work)
    import torch

    torch.cuda.synchronize()
    before = torch.cuda.memory_allocated()
    torch.cuda.reset_peak_memory_stats()
    work()
    torch.cuda.synchronize()
    return round((torch.cuda.max_memory_allocated() - before) / 1e6, 1)


def _peak_on_cpu(work: Callable[[], object]) -> float | None:
    try:
        # Else freed memory that malloc holds on to would be used again unseen.
        ctypes.CDLL(None).malloc_trim(0)
        (_SELF / "clear_refs").write_text("5")  # sets the highest mark to what is resident now
        before = _kilobytes("VmRSS")
    except (OSError, AttributeError):  # not Linux, another C library, or not allowed
        work()
        return None
    work()
    return round(max(0, _kilobytes("VmHWM") - before) * 1024 / 1e6, 1)


def _kilobytes(name: str) -> int:
    lines = (_SELF / "status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))


class Difference(NamedTuple):
    """How far a backend is from what is right.

    Attributes:
        backend: Its name.
        what: The array that was compared.
        error: Norm of the difference over the norm of what is right.
        allowed: What rounding can explain.
    """

    backend: str
    what: str
    error: float
    allowed: float


def require_agreement(differences: Iterable[Difference]) -> None:
    """End here unless all backends compute the same.

    Raises:
        DisagreementError: If one is further off than rounding can explain, or not a number.
    """
    found = [
        f"{d.backend}: {d.what} is off by {d.error:.1e} (allowed: {d.allowed:.0e})"
        for d in differences
        if not d.error <= d.allowed
    ]
    if found:
        raise DisagreementError(f"the backends disagree, so nothing was timed: {'; '.join(found)}")


def run_facts(device: str, threads: int) -> dict[str, str | int]:
    """What every row of a run, and of no other, shares: when, device, threads and versions."""
    return {
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M:%S"),
        "device": device_name(device),
        "threads": threads,
        "torch": _version("torch"),
        "vnca": vnca.__version__,
    }


def device_name(device: str) -> str:
    """What the GPU or the processor is called."""
    if device != "cpu":
        import torch

        return torch.cuda.get_device_name()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def write_json(path: Path, facts: Row, rows: Sequence[Row]) -> None:
    """One object: facts of the run, and its rows.

    Raises:
        OutputError: If it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps({**facts, "rows": rows}, indent=2) + "\n")


def append_csv(path: Path, facts: Row, rows: Sequence[Row]) -> None:
    """Add rows, each with the facts of the run, to a table, or begin it.

    Raises:
        FileFormatError: If the table there has other columns.
        OutputError: If it cannot be written.
    """
    columns = [*facts, *rows[0]]
    earlier = ""
    if path.exists():
        earlier = existing_file(path).read_text()
        found = next(csv.reader(earlier.splitlines()), [])
        if found != columns:
            raise FileFormatError(
                f"{path}: a table with other columns than these; name another file"
            )
    text = io.StringIO()
    table = csv.DictWriter(text, columns, lineterminator="\n")
    if not earlier:
        table.writeheader()
    table.writerows({**facts, **row} for row in rows)
    with whole_file(path) as temporary:
        temporary.write_text(earlier + text.getvalue())
