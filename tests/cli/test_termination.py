import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.cli.terminal import finishing, terminable
from vnca.core.errors import Terminated

Vnca = Callable[..., Any]


def sigterm(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def test_sigterm_ends_a_command_with_its_code_and_no_traceback(
    vnca: Vnca, frame: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr("vnca.cli.info.describe", sigterm)
    outcome = vnca("info", frame)
    assert outcome.code == 143
    assert "Traceback" not in outcome.err
    assert signal.getsignal(signal.SIGTERM) is before


def test_sigterm_cleans_up_as_ctrl_c_does() -> None:
    with pytest.raises(KeyboardInterrupt), terminable():
        sigterm()


def test_sigterm_waits_until_the_work_is_finished() -> None:
    finished = False

    def work() -> None:
        nonlocal finished
        with terminable(), finishing() as stop_if_asked:
            stop_if_asked()
            sigterm()
            finished = True
            stop_if_asked()

    with pytest.raises(Terminated):
        work()
    assert finished


def test_a_second_sigterm_does_not_wait() -> None:
    with finishing():
        sigterm()
        with pytest.raises(Terminated):
            sigterm()
