import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import vnca as library
from vnca.cli import COMMANDS

Vnca = Callable[..., Any]


def test_help_lists_every_command(vnca: Vnca) -> None:
    for arguments in (["--help"], ["--help-all"], ["-h"], ["help"], []):
        outcome = vnca(*arguments)
        assert outcome.code == (0 if arguments else 2)
        assert all(command in outcome.out for command in COMMANDS)


def test_the_version_is_told(vnca: Vnca) -> None:
    assert vnca("--version").out == f"vnca {library.__version__}\n"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(vnca: Vnca, command: str) -> None:
    outcome = vnca(command, "--help")
    assert outcome.code == 0
    assert f"vnca {command}" in outcome.out
    assert not outcome.err


@pytest.mark.parametrize("arguments", ["info {}", "--help", "info --help"])
def test_a_reader_that_goes_away_is_no_error(arguments: str, frame: Path) -> None:
    code = "import sys; from vnca.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, *arguments.format(frame).split()]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        assert program.stdout is not None
        program.stdout.close()
        _, err = program.communicate(timeout=60)
    assert program.returncode == 0
    assert err == b""
