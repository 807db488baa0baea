"""Methods side by side, as a user compares them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Vnca = Callable[..., Any]
QUICK = ("--iterations", 1, "--features", "efficientnet")


def test_two_folders_are_compared(
    vnca: Vnca, made_smoke: Path, style: Path, tmp_path: Path
) -> None:
    for name in ("one", "two"):
        out = tmp_path / name
        call = ("peers", "run", "lnst", made_smoke, style, "-o", out, *QUICK, "--spreading", 0)
        outcome = vnca(*call, "--rate", 0.5 if name == "one" else 0.0)
        assert outcome.code == 0, outcome.err
    methods = [f"{name}={tmp_path / name}" for name in ("one", "two")]
    out = tmp_path / "report"
    call = ("compare", made_smoke, style, "-o", out, "--methods", *methods, "--size", 64)
    outcome = vnca(*call, "--study")
    assert outcome.code == 0, outcome.err
    assert "Warp error, short" in outcome.out
    names = {path.name for path in out.iterdir()}
    expected = {"picture.png", "report.html", "report.json", "study.html", "films.mp4"}
    assert expected <= names
    found = json.loads((out / "report.json").read_text())
    assert found["one"]["Density changed"] > found["two"]["Density changed"]
    assert found["one"]["Seconds a frame"] > 0


def test_what_cannot_be_compared_is_named(
    vnca: Vnca, made_smoke: Path, style: Path, tmp_path: Path
) -> None:
    call = ("compare", made_smoke, style, "-o", tmp_path / "out")
    complaint = vnca(*call, "--methods", f"mine={tmp_path / 'nowhere'}").complaint
    assert "--methods mine=" in complaint
    assert "--methods guo" in vnca(*call, "--methods", "guo").complaint


def test_answers_to_a_study_are_evaluated_or_refused(vnca: Vnca, tmp_path: Path) -> None:
    path = tmp_path / "answers.json"
    path.write_text("[]")
    complaint = vnca("compare", "--study-report", path, "--methods", "vnca", "tnst").complaint
    assert "answers.json: no answers of this study" in complaint
