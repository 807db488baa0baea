"""`vnca farm`, `vnca sweep` and `vnca plan` as a user meets them."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.farm.plan import Costs, Line
from vnca.painting.tiles import bytes_needed
from vnca.rule.model import MODEL_NAME

Vnca = Callable[..., Any]


@pytest.fixture
def shot(smoke: Path, tmp_path: Path) -> Path:
    path = tmp_path / "shot.toml"
    path.write_text('sequence = "smoke"\nout = "painted"\nstyle = "ink"\n')
    return path


@pytest.mark.parametrize("format", ["openjd", "opencue", "tractor", "commands"])
def test_a_job_is_written(vnca: Vnca, shot: Path, tmp_path: Path, format: str) -> None:
    job = tmp_path / "jobs" / "job"
    options = ("--chunk-size", 2, "--env", "OMP_NUM_THREADS=8", "--program", "/opt/my/vnca -x")
    outcome = vnca("farm", format, shot, "-o", job, *options)
    assert (outcome.code, outcome.err) == (0, f"job: {job}\n")
    text = job.read_text()
    for word in ("/opt/my/vnca", str(shot), "OMP_NUM_THREADS", "--state-in"):
        assert word in text


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["farm", "slurm", "SHOT", "-o", "job"], "slurm"),
        (["farm", "openjd", "-o", "job"], "names no file"),
        (["farm", "openjd", "gone.toml", "-o", "job"], "gone.toml: no such file"),
        (["farm", "openjd", "SHOT", "-o", "job", "--env", "A"], "--env A: expected NAME=VALUE"),
        (["farm", "openjd", "SHOT", "-o", "job", "--retries", "-1"], "--retries -1: must not be"),
        (["farm", "openjd", "SHOT", "-o", "job", "--chunk-size", "0"], "--chunk-size 0: expected"),
        (["farm", "openjd", "SHOT", "-o", "job", "--preroll", "4"], "needs --handover preroll"),
        (["plan", "SMOKE"], "--model, --style: expected one of them"),
        (["plan", "SMOKE", "--style", "ink", "--machines", "0"], "--machines 0: at least 1"),
        (["plan", "SMOKE", "--style", "ink", "--tile", "20"], "--tile 20: expected a multiple of"),
        (["plan", "gone", "--style", "ink"], "gone: no such file or folder"),
        (["sweep", "gone.toml"], "gone.toml: no such file"),
        (["sweep", "SHOT"], "shot.toml: sequence: no such option"),
        (["sweep", "SHOT", "--processes", "0"], "--processes 0: at least 1 is needed"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_is_said_in_one_line(
    vnca: Vnca, shot: Path, smoke: Path, words: list[str], complaint: str
) -> None:
    named = {"SHOT": str(shot), "SMOKE": str(smoke)}
    assert complaint in vnca(*(named.get(word, word) for word in words)).complaint
    assert not Path("job").exists()


@pytest.fixture
def known_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = Costs(Line(1.0, 0.0), Line(0.5, 1e-4), Line(1e4, 10))
    monkeypatch.setattr("vnca.cli.farm.measured_costs", lambda *_, **__: costs)


@pytest.mark.usefixtures("known_costs")
def test_a_plan_is_printed(vnca: Vnca, model: Path, smoke: Path) -> None:
    outcome = vnca("plan", smoke, "--model", model, "--machines", 2, "--tile", 8, "--ranks", 3)
    assert outcome.code == 0
    assert re.match(r"3 frames, at most [\d,]+ cells of the automaton \(frame 1\)", outcome.out)
    for word in ("time ", "on 2 like it", "memory  0.14 GB", "disk ", "each 4 steps", "3 ranks, 4"):
        assert word in outcome.out
    told = json.loads(vnca("plan", smoke, "--model", model, "--tile", 8, "--json").out)
    assert [frame["frame"] for frame in told["frames"]] == [1, 2, 3]
    assert told["exchange"]["tiles"] > 1
    smoke_cells = min(told["frames"][0]["smoke"], told["exchange"]["largest"])
    assert told["plan"]["memory"] == bytes_needed(smoke_cells, grid=1, finer=1)


def test_ranks_of_a_plan_need_tiles(vnca: Vnca, model: Path, smoke: Path) -> None:
    complaint = vnca("plan", smoke, "--model", model, "--ranks", 2).complaint
    assert "--ranks: share tiles; give --tile, too" in complaint


def test_costs_are_measured_once_and_kept(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By painting; what that takes is another on each machine, but never nothing."""
    monkeypatch.setenv("VNCA_CACHE", str(tmp_path / "cache"))
    first = vnca("plan", smoke, "--model", model, "--json")
    assert "measuring what a cell costs" in first.err
    costs = json.loads(first.out)["costs"]
    assert costs["begin"]["least"] > 0
    assert costs["disk"]["a_cell"] > 0
    assert [path.name[:6] for path in (tmp_path / "cache").iterdir()] == ["costs_"]
    again = vnca("plan", smoke, "--model", model / MODEL_NAME, "--json")
    assert again.err == ""
    assert json.loads(again.out)["costs"] == costs
