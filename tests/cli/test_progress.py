import io
from contextlib import redirect_stderr

import pytest

from vnca.cli import main
from vnca.cli.terminal import Progress, say, tracked
from vnca.core.errors import SequenceError


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_an_error_starts_a_line_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        for item in tracked(range(3), "counting", 3, "numbers"):
            if item == 1:
                raise SequenceError("one is no number")

    monkeypatch.setattr("vnca.cli.info.describe", fail)
    with redirect_stderr(Terminal()) as terminal:
        assert main(["info", "x"]) == 2
    assert "counting 1/3" in terminal.getvalue()
    assert terminal.getvalue().splitlines()[-1] == "vnca: one is no number"


def test_what_is_said_meanwhile_stands_on_a_line_of_its_own() -> None:
    with redirect_stderr(Terminal()) as terminal, Progress("counting", 2, "numbers") as progress:
        progress.show(1)
        say("a word")
        say("another")
        progress.show(2)
    lines = terminal.getvalue().split("\n")
    assert lines[1:3] == ["a word", "another"]
    assert "counting 2/2" in lines[3]
    assert lines[4] == ""


def test_the_pace_counts_only_what_was_done_now(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    with redirect_stderr(Terminal()) as terminal:
        with Progress("counting", 20, "numbers", already=10) as progress:
            now = 10.0
            progress.show(15)
        assert "0.50 numbers/s  0:10 left" in terminal.getvalue()
