import csv
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from vnca.bench import contenders
from vnca.core.errors import BackendUnavailableError
from vnca.engine import native
from vnca.engine.native import BACKEND
from vnca.engine.reference import equations as reference
from vnca.engine.triton import step as triton

Vnca = Callable[..., Any]
STEP = (
    *("bench", "step", "--grid", "9x8x7", "--hidden", "16", "--occupancy", "0.4"),
    *("--threads", "1", "--repeats", "1"),
)
STYLIZE = ("--threads", "1", "--repeats", "1", "--steps-per-frame", "2")


@pytest.fixture(autouse=True)
def threads_as_before() -> Iterator[None]:
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def test_steps_are_compared_and_kept(vnca: Vnca, tmp_path: Path) -> None:
    report, table = tmp_path / "run.json", tmp_path / "step.csv"
    arguments = (*STEP, "--backends", "plain,reference", "--json", report, "--csv", table)
    outcome = vnca(*arguments, "--passes", "forward,backward,both")
    again = vnca(*arguments, "--passes", "forward,backward,both")
    assert (outcome.code, again.code) == (0, 0), outcome.err
    assert outcome.out.count("×") == 6
    document = json.loads(report.read_text())
    assert document["device"]
    assert document["peak_gflops"] > 0
    assert len(document["rows"]) == 6
    keys = [
        "backend",
        "dtype",
        "pass",
        "grid",
        "hidden",
        "occupancy",
        "ns_per_cell",
        "gflops",
        "peak_mb",
    ]
    assert all(set(keys) <= set(row) for row in document["rows"])
    assert {row["pass"] for row in document["rows"]} == {"forward", "backward", "both"}
    with table.open(newline="") as file:
        assert len(list(csv.DictReader(file))) == 12


def test_rows_can_be_printed_for_programs(vnca: Vnca) -> None:
    outcome = vnca(*STEP, "--backends", "reference", "--passes", "forward", "--json", "-")
    assert outcome.code == 0, outcome.err
    document = json.loads(outcome.out)
    assert [row["backend"] for row in document["rows"]] == ["reference"]
    assert document["peak_gflops"] > 0
    assert "ns a cell" in outcome.err


def test_no_speed_up_is_told_of_backends_that_disagree(
    vnca: Vnca, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def wrong(state: Tensor, *rest: Any) -> Tensor:
        return 1.01 * reference.update(state, *rest)

    monkeypatch.setattr(type(BACKEND), "update", lambda self, **options: wrong)
    report, table = tmp_path / "run.json", tmp_path / "step.csv"
    kept = ("--json", report, "--csv", table)
    outcome = vnca(*STEP, "--backends", "plain,native", *kept)
    assert "disagree" in outcome.complaint
    assert "native: gradient of the state is off by" in outcome.complaint
    assert "×" not in outcome.out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("step", "--grid", "4x4"), "--grid 4x4"),
        (("step", "--grid", "axbxc"), "--grid axbxc"),
        (("step", "--grid", "0x1x1"), "--grid 0x1x1"),
        (("step", "--occupancy", "2"), "--occupancy 2"),
        (("step", "--backends", "fastest"), "--backends fastest"),
        (("step", "--backends", "triton"), "--backends triton"),
        (("step", "--passes", "sideways"), "--passes sideways"),
        (("step", "--dtypes", "float16"), "--dtypes float16"),
        (("step", "--csv", "/dev/null/none.csv"), "/dev/null"),
        (("train", "--backends", "triton"), "--backends triton"),
        (("train", "--rollout", "0"), "--rollout 0"),
        (("train", "--view-size", "3"), "--view.size 3"),
        (("train", "--frame", "none.vdb"), "none.vdb"),
        (("train", "--memory-budget", "much"), "--memory-budget much"),
        (("stylize", "--model", "none"), "--sequence"),
        (("stylize", "--backends", "triton"), "--backends triton"),
        (("stylize", "--length", "0"), "--length 0"),
        (("everything",), "step, train, stylize"),
        ((), "step, train, stylize"),
    ],
)
def test_what_cannot_be_measured_is_told_in_one_line(
    vnca: Vnca, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], message: str
) -> None:
    # Other tests may have brought up Triton's interpreter, which runs anywhere, endlessly slow.
    monkeypatch.setattr(triton, "_interpreted", False)
    assert message in vnca("bench", *options).complaint


def test_backends_that_are_not_there_are_refused_only_by_name(
    vnca: Vnca, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(native, "unavailable", lambda *precision: "it was not built")
    monkeypatch.setattr(contenders, "_why_not_compiled", lambda device: "there is no compiler")
    outcome = vnca(*STEP, "--passes", "forward")
    assert outcome.code == 0, outcome.err
    assert "native" not in outcome.out
    assert "compile" not in outcome.out
    assert "it was not built" in vnca(*STEP, "--backends", "native").complaint
    assert "no compiler" in vnca(*STEP, "--backends", "compile").complaint


def test_the_help_tells_of_all_three(vnca: Vnca) -> None:
    outcome = vnca("bench", "--help")
    assert outcome.code == 0
    assert all(name in outcome.out for name in ("step", "train", "stylize"))


def test_training_on_a_given_frame_is_timed(
    vnca: Vnca, frame: Path, style: Path, tmp_path: Path
) -> None:
    report = tmp_path / "train.json"
    outcome = vnca(
        *("bench", "train", "--frame", frame, "--style", style, "--json", report),
        *("--backends", "plain,reference", "--hidden", "8", "--rollout", "2"),
        *("--view-size", "32", "--device", "cpu", "--threads", "1", "--repeats", "1"),
    )
    assert outcome.code == 0, outcome.err
    assert outcome.out.count("×") == 2
    rows = json.loads(report.read_text())["rows"]
    assert [row["backend"] for row in rows] == ["plain", "reference"]


def test_training_is_timed_in_every_backend_that_has_gradients(
    vnca: Vnca, frame: Path, style: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timed: list[str] = []

    def noted(training: object, backends: tuple[str, ...], *, repeats: int) -> None:
        timed.extend(backends)
        raise BackendUnavailableError("enough is known")  # Triton's interpreter takes minutes

    monkeypatch.setattr("vnca.cli.bench.training.measure_training", noted)
    monkeypatch.setattr(contenders, "_why_not", lambda name, dtype, device: None)
    asked = ("bench", "train", "--frame", frame, "--style", style, "--device", "cpu")
    assert "enough is known" in vnca(*asked).complaint
    assert timed == ["plain", "compile", "reference", "native", "triton"]
    refused = vnca(*asked, "--backends", "plain,onnx")
    assert refused.code == 2
    assert "--backends plain,onnx: expected of plain" in refused.complaint


def test_painting_a_given_sequence_is_timed(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    report = tmp_path / "stylize.json"
    outcome = vnca(
        *("bench", "stylize", "--model", model, "--sequence", smoke, *STYLIZE),
        *("--frames", "1-2", "--backends", "numpy", "--json", report),
    )
    assert outcome.code == 0, outcome.err
    rows = json.loads(report.read_text())["rows"]
    assert [row["files"] for row in rows] == [False, True]
    assert all((row["frames"], row["hidden"]) == (2, 8) for row in rows)


def test_painting_a_simulated_plume_is_timed(vnca: Vnca) -> None:
    outcome = vnca("bench", "stylize", "--resolution", "8", "--length", "2", *STYLIZE)
    assert outcome.code == 0, outcome.err
    assert "with files" in outcome.out


def test_painting_is_timed_without_torch(model: Path, smoke: Path) -> None:
    code = """
import sys
from importlib.machinery import PathFinder
find = PathFinder.find_spec
PathFinder.find_spec = lambda name, *where: None if name == "torch" else find(name, *where)
from vnca.cli import main
sys.exit(main(sys.argv[1:]))
"""
    arguments = ("bench", "stylize", "--model", str(model), "--sequence", str(smoke), *STYLIZE)
    command = [sys.executable, "-c", code, *arguments]
    outcome = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert outcome.returncode == 0, outcome.stderr
    assert "frames/s" in outcome.stdout


def test_painting_is_told_in_seconds_beside_the_papers(vnca: Vnca, tmp_path: Path) -> None:
    sizes = ("--grid", "12x20x10", "--occupancy", "0.3", "--frames", "2", "--steps", "2")
    table = tmp_path / "rows.json"
    small = (*sizes, "--hidden", "16", "--threads", "1", "--precisions", "float32")
    outcome = vnca("bench", "paint", *small, "--json", table)
    assert outcome.code == 0, outcome.err
    assert "12x20x10 cells" in outcome.out
    assert "the paper: 0.8 s on an RTX 3090 Ti" in outcome.out
    assert len(json.loads(table.read_text())["rows"]) == 1


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--grid", "0x1x1"),
        ("--occupancy", "0"),
        ("--frames", "1"),
        ("--steps", "0"),
        ("--precisions", "float8"),
        ("--device", "mps"),
    ],
)
def test_what_cannot_be_painted_is_told(vnca: Vnca, option: str, value: str) -> None:
    assert option in vnca("bench", "paint", option, value).complaint
