"""Runs the vnca command line and kills it, as `kill -9` does, at a moment that is asked for.

    python killed.py MOMENT NUMBER COMMAND …

The moments of writing come again and again; NUMBER says at which of them, from 1:

    torn      a file is half written, and not under its name yet
    written   it is written whole, and not under its name yet
    renamed   it is under its name
    seconds   so long after the command began, wherever it is
    never     not at all: how often each moment came, how long it took, and the most memory it
              had at a time is printed as JSON
"""

import json
import os
import signal
import stat
import sys
import threading
import time
from pathlib import Path
from typing import NoReturn

from vnca.cli import HOMES, main
from vnca.cli.options import command_at

moment, number, command = sys.argv[1], float(sys.argv[2]), sys.argv[3:]
counts = dict.fromkeys(("torn", "written", "renamed"), 0)
sync, replace = os.fsync, Path.replace


def die(*_: object) -> NoReturn:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def is_now(kind: str) -> bool:
    counts[kind] += 1
    return kind == moment and counts[kind] == number


def synced(handle: int) -> None:
    status = os.fstat(handle)
    is_file = stat.S_ISREG(status.st_mode)
    if is_file and is_now("torn"):
        os.ftruncate(handle, status.st_size // 2)
        die()
    sync(handle)
    if is_file and is_now("written"):
        die()


def renamed(self: Path, target: Path) -> Path:
    result = replace(self, target)
    if is_now("renamed"):
        die()
    return result


def peak_kib() -> int:
    """The most memory this program had at a time; what getrusage tells begins with its parent's."""
    status = Path("/proc/self/status")
    words = status.read_text().split() if status.exists() else ["VmHWM:", "0"]
    return int(words[words.index("VmHWM:") + 1])


os.fsync, Path.replace = synced, renamed  # type: ignore[assignment]
command_at(HOMES[command[0]])
begun = time.monotonic()
if moment == "seconds":
    timer = threading.Timer(number, die)
    timer.daemon = True
    timer.start()
code = main(command)
if moment == "never":
    print(json.dumps({**counts, "seconds": time.monotonic() - begun, "peak_kib": peak_kib()}))
sys.exit(code)
