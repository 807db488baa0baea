"""How much memory a program has, may have, and is asked to take."""

import os
import re
from math import inf
from pathlib import Path

from vnca.core.errors import OptionError

_UNITS = {"MB": 10**6, "GB": 10**9, "TB": 10**12, "MIB": 2**20, "GIB": 2**30, "TIB": 2**40}


def memory_budget(text: str) -> int | None:
    """Bytes of a `--memory-budget`, such as 12GB or 800 MiB; None for `auto`.

    Raises:
        OptionError: If it is neither.
    """
    if text == "auto":
        return None
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?([MGT]I?B)", text.upper())
    if found is None:
        raise OptionError(f"`memory_budget` {text}: expected auto, or a size such as 12GB or 800MB")
    return round(float(found[1]) * _UNITS[found[2]])


def used_memory() -> int:
    """Bytes that this program has now, 0 where that cannot be known."""
    pages = _number(Path("/proc/self/statm"), r"\d+ (\d+)")
    return 0 if pages is None else pages * os.sysconf("SC_PAGE_SIZE")


def free_memory() -> float:
    """Bytes that it may have beside, as the system says; infinity where it does not say."""
    available = _number(Path("/proc/meminfo"), r"MemAvailable:\s+(\d+) kB")
    group = Path("/sys/fs/cgroup")  # what a container may have
    limit, taken = (_number(group / f"memory.{name}", r"(\d+)") for name in ("max", "current"))
    cached = _number(group / "memory.stat", r"inactive_file (\d+)") or 0
    return min(
        inf if available is None else available * 1024,
        inf if limit is None or taken is None else limit - taken + cached,
    )


def _number(path: Path, pattern: str) -> int | None:
    """A number in a file of the system; None where that is not there."""
    try:
        found = re.search(pattern, path.read_text())
    except OSError:
        return None
    return None if found is None else int(found[1])
