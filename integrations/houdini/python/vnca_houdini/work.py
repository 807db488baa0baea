# SPDX-License-Identifier: Apache-2.0
"""Runs vnca, and tells how far it has come."""

import json
import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from queue import Empty, Queue
from threading import Thread
from typing import IO

from .request import ProblemError

_HOUDINIS = ("PYTHONPATH", "PYTHONHOME", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
"""Variables by which Houdini's own libraries would get into another Python."""
TICK = 0.2
"""Seconds, at most, between two calls by which Houdini learns how far the work is."""


def run(program: str, words: Sequence[str], tell: Callable[[float, str], None]) -> list[str]:
    """Run vnca to its end; what `tell` raises ends it.

    Args:
        program: The program.
        words: What it is told.
        tell: Is given how far the work is, from 0 to 1, and a line; often, so that Esc is heard.

    Returns:
        What it found worth noting.

    Raises:
        ProblemError: If it fails, with its own line.
    """
    environment = {name: value for name, value in os.environ.items() if name not in _HOUDINIS}
    notes: list[str] = []
    message = ""
    process = subprocess.Popen(
        [program, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=environment,
        encoding="utf-8",
        errors="replace",
    )
    assert process.stderr is not None
    done, line = 0.0, "starting"
    try:
        for told in _events(process.stderr):
            if told.get("event") == "progress" and told["total"]:
                line = f"{told['what']} {told['done']} of {told['total']} {told['unit']}"
                done = told["done"] / told["total"]
            elif told.get("event") == "note":
                notes.append(told["text"])
            elif told.get("event") == "error":
                message = told["message"]
            tell(done, line)
        code = process.wait()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    if code:
        raise ProblemError(message or f"{program} ended unexpectedly, with code {code}")
    return notes


def _events(stream: "IO[str]") -> "Iterator[dict]":
    """What is told, and an empty event whenever nothing was for a while."""
    lines: Queue[str] = Queue()

    def read() -> None:
        with stream:
            for line in stream:
                lines.put(line)
        lines.put("")

    Thread(target=read, daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=TICK)
        except Empty:
            yield {}
            continue
        if not line:
            return
        yield _event(line)


def _event(line: str) -> dict:
    try:
        told = json.loads(line)
    except ValueError:
        return {}
    return told if isinstance(told, dict) else {}
