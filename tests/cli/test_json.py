"""What is printed for programs."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.cli import main

Vnca = Callable[..., Any]


def events(err: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in err.splitlines()]


def test_a_painting_tells_programs_of_its_progress_and_results(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    out, film = tmp_path / "painted", tmp_path / "film.gif"
    outcome = vnca(
        *("stylize", model, smoke, "-o", out, "--json-progress", "--preview", film),
        *("--rows", "32", "--columns", "32", "--warmup", "2", "--steps-per-frame", "1"),
    )
    assert (outcome.code, outcome.out) == (0, "")
    told = events(outcome.err)
    progress = [event for event in told if event["event"] == "progress"]
    assert progress[-1] == {
        "event": "progress",
        "what": "painting",
        "done": 3,
        "total": 3,
        "unit": "frames",
        "seconds_left": 0.0,
        "note": "",
    }
    results = {event["what"]: event["path"] for event in told if event["event"] == "result"}
    assert results == {"painted": str(out), "film": str(film)}


@pytest.mark.parametrize("words", [["info", "nothing.vdb"], ["info"], ["dance"]], ids=" ".join)
def test_a_mistake_is_an_object_with_its_exit_code(vnca: Vnca, words: list[str]) -> None:
    plain = vnca(*words).complaint.removeprefix("vnca: ")
    outcome = vnca("--json-progress", *words)
    assert outcome.code == 2
    assert events(outcome.err) == [{"event": "error", "message": plain, "exit_code": 2}]


@pytest.mark.parametrize(
    ("fault", "code"), [(KeyboardInterrupt(), 130), (ZeroDivisionError("so"), 1)]
)
def test_whatever_else_is_written_becomes_notes_and_every_end_is_told(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    fault: BaseException,
    code: int,
) -> None:
    def fail(*_: object) -> None:
        print("of a library", file=sys.stderr)
        print("\n without an end", end="", file=sys.stderr)
        raise fault

    monkeypatch.setattr("vnca.cli.info.describe", fail)
    words = ["info", "x", "--json-progress"]
    if code == 1:  # Python prints the traceback when it leaves.
        with pytest.raises(ZeroDivisionError):
            main(words)
    else:
        assert main(words) == code
    told = events(capfd.readouterr().err)
    texts = [event.get("text") or event["event"] for event in told]
    assert texts == ["of a library", "without an end", "error"]
    assert told[-1]["exit_code"] == code


def test_what_a_file_is_can_be_read_by_programs(vnca: Vnca, model: Path, frame: Path) -> None:
    found = json.loads(vnca("info", model, "--json").out)
    assert (found["kind"], found["weights"], found["path"]) == ("model", 352, str(model))
    assert found["scales"]["gamma"] == pytest.approx(0.7)
    assert found["training"]["style"] == "night.png"
    found = json.loads(vnca("info", frame, "--json").out)
    assert found["kind"] == "vdb"
    grids = {grid["name"]: grid for grid in found["grids"]}
    assert list(grids) == ["density", "velocity", "temperature"]
    assert grids["density"]["box"] == [[-2, 5, 10], [8, 15, 20]]
    assert grids["density"]["voxel_size"] == pytest.approx([0.1] * 3)
    assert found["metadata"]["shot"] == "shot 2"
