# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python that paints, which comes with the extension, and the one that trains."""

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

from .problem import ProblemError

HOW_TO_TRAIN = (
    "Make a Python environment with vnca in it, pip install 'vnca[train]', and name its folder in "
    "Preferences > Add-ons > vnca. Painting with the styles of the library needs none."
)
NO_TRAINING = (
    "Training needs a Python environment with vnca[train],",
    "which the preferences name. Styles of the library",
    "and models paint without it.",
)
"""What the panel says where there is none, a line each."""
_PROGRAMS = ("bin/python3", "bin/python", "Scripts/python.exe", "python.exe", "python3", "python")


@dataclass(frozen=True)
class Interpreter:
    """How a worker is started.

    Attributes:
        words: The program, and what comes before the job.
        environment: Variables to set; those that are None are removed.
    """

    words: tuple[str, ...]
    environment: Mapping[str, str | None] = field(default_factory=dict)

    def variables(self) -> dict[str, str]:
        """The environment of the worker."""
        merged = {**os.environ, **self.environment}
        return {name: value for name, value in merged.items() if value is not None}


def painter(python: str, blender: str, worker: Path) -> Interpreter:
    """What paints: Blender's own Python, with the vnca that comes with the extension.

    Args:
        python: `sys.executable`.
        blender: `bpy.app.binary_path`, for where Python is no program of its own.
        worker: Folder of the worker.

    Raises:
        ProblemError: If there is no vnca.
    """
    spec = find_spec("vnca")
    if spec is None or not spec.origin:
        raise ProblemError("vnca is missing in the extension; install the zip of your platform")
    environment = {
        "PYTHONPATH": str(Path(spec.origin).parent.parent),
        "PYTHONNOUSERSITE": "1",
        "PYTHONUTF8": "1",
    }
    if Path(python).stem.lower().startswith("python") or not blender:
        return Interpreter((python, str(worker)), environment)
    program = ("--background", "--factory-startup", "--python-exit-code", "1", "--python")
    return Interpreter((blender, *program, str(worker / "__main__.py"), "--"), environment)


def trainer(told: str, worker: Path) -> Interpreter:
    """What trains: the environment that is told, or else one whose `vnca` is on the path.

    Args:
        told: Folder of an environment, or its Python; empty if none is told.
        worker: Folder of the worker.

    Raises:
        ProblemError: If there is none.
    """
    if told:
        python = _python_of(Path(told).expanduser())
        if python is None:
            raise ProblemError(f"{told}: no Python environment. {HOW_TO_TRAIN}")
    else:
        program = shutil.which("vnca")
        python = _python_of(Path(program).resolve().parent) if program else None
        if python is None:
            raise ProblemError(f"Training needs Python with vnca and torch. {HOW_TO_TRAIN}")
    environment = {"PYTHONPATH": None, "PYTHONHOME": None, "PYTHONUTF8": "1"}
    return Interpreter((str(python), str(worker)), environment)


def _python_of(path: Path) -> Path | None:
    if path.is_file():
        return path
    found = (path / name for name in _PROGRAMS)
    return next((python for python in found if python.is_file()), None)
