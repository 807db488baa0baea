# SPDX-License-Identifier: Apache-2.0
"""Runs vnca, and tells how far it has come."""

import json
import os
import subprocess
from collections.abc import Callable, Sequence

from .request import ProblemError

_HOUDINIS = ("PYTHONPATH", "PYTHONHOME", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
"""Variables by which Houdini's own libraries would get into another Python."""


def run(program: str, words: Sequence[str], tell: Callable[[float, str], None]) -> list[str]:
    """Run vnca to its end; what `tell` raises ends it.

    Args:
        program: The program.
        words: What it is told.
        tell: Is given how far the work is, from 0 to 1, and a line.

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
    try:
        for line in process.stderr:
            told = _event(line)
            if told.get("event") == "progress" and told["total"]:
                line = f"{told['what']} {told['done']} of {told['total']} {told['unit']}"
                tell(told["done"] / told["total"], line)
            elif told.get("event") == "note":
                notes.append(told["text"])
            elif told.get("event") == "error":
                message = told["message"]
        code = process.wait()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        process.stderr.close()
    if code:
        raise ProblemError(message or f"{program} ended unexpectedly, with code {code}")
    return notes


def _event(line: str) -> dict:
    try:
        told = json.loads(line)
    except ValueError:
        return {}
    return told if isinstance(told, dict) else {}
