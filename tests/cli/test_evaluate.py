import json
import math
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from vnca.core.errors import BackendUnavailableError
from vnca.features import FeatureNetwork, load_network
from vnca.rule.model import MODEL_NAME

Vnca = Callable[..., Any]
FEW = ("--warmup", "4", "--steps-per-frame", "2")
SMALL = ("--size", "64", "--style-scale", "1", *FEW)
NAMES = {
    "style.score", "style.by_edges", "style.by_efficientnet",
    "structure.lines", "structure.width", "structure.contrast", "structure.direction",
    "structure.regions", "structure.patches", "views.spread", "views.reprojection",
    "time.warp_short", "time.warp_long", "time.flow",
    "motion.direction", "motion.magnitude", "motion.transport",
    "density.mass_change", "density.moved",
}  # fmt: skip


@pytest.fixture(autouse=True)
def small_pictures_of_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vnca.metrics.MOTION_SIZE", 40)


class Page(HTMLParser):
    """What a page wants from elsewhere, and whether what it opens is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img", "link"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_a_report_has_every_measure_and_needs_nothing_else(
    vnca: Vnca, model: Path, smoke: Path, style: Path, tmp_path: Path
) -> None:
    out = tmp_path / "report"
    outcome = vnca("evaluate", model, smoke, "--style", style, "--out", out, *SMALL)
    assert outcome.code == 0, outcome.err
    measures = json.loads((out / "report.json").read_text())
    assert set(measures) == NAMES
    for name, measure in measures.items():
        assert name in outcome.out
        assert measure["unit"]
        if measure["value"] is None:
            reasons = {
                "time.warp_long": "it takes 8 frames in a row",
                "structure.width": "large enough to tell",  # so few pixels have no strokes
            }
            assert reasons[name] in measure["reason"]
    assert measures["time.warp_short"]["ratio"] > 0
    assert measures["style.by_edges"]["trained_with"] is None  # an old file does not tell
    assert measures["structure.regions"]["trained_with"] is False
    assert set(measures["density.moved"]["frames"]) == {"1", "2", "3"}
    assert len(measures["views.spread"]["views"]) == 32
    assert {"network", "dis", "unit"} <= set(measures["motion.direction"])

    text = (out / "report.html").read_text()
    page = Page(text)
    assert not page.open
    assert len(page.links) >= 20
    own = ("data:image/webp;base64,", "data:,")  # the second is no icon
    assert all(link.startswith(own) for link in page.links)
    assert "script" not in text
    assert "url(" not in text
    plots = re.findall(r"<svg.*?</svg>", text)
    assert len(plots) >= 3
    for plot in plots:
        ElementTree.fromstring(plot)


def test_what_a_run_was_trained_on_is_what_it_is_measured_on(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    run = tmp_path / "trained"
    trained = (*tiny, "--view.gamma", "3", "--appearance.style-scale", "2")
    assert vnca("train", frame, style, "--out", run, *trained).code == 0
    evaluated = ("evaluate", run, "--velocity-grid", "none", "--size", "112", *FEW)
    outcome = vnca(*evaluated)
    assert outcome.code == 0, outcome.err
    measures = json.loads((run / "evaluation" / "report.json").read_text())
    assert list(measures["style.score"]["frames"]) == ["2"]
    assert "trained with features 'efficientnet'" in outcome.err
    assert measures["style.by_efficientnet"]["trained_with"] is True
    assert measures["style.by_edges"]["trained_with"] is False
    assert measures["structure.regions"]["trained_with"] is True
    assert measures["structure.patches"]["trained_with"] is False
    page = (run / "evaluation" / "report.html").read_text()
    assert page.count("Training compared regions, too") == 1
    assert list(measures["style.by_edges"]["frames"]) == ["2"]
    assert measures["time.warp_short"]["reason"] == "it takes 2 frames in a row"
    assert "Not measured" in (run / "evaluation" / "report.html").read_text()
    # The picture is compared as large as it was shown in training, and as its cells are.
    sized = evaluated[: -len(FEW) - 1]
    complaint = vnca(*sized, "64", *FEW).complaint
    assert "--size 64: makes the picture" in complaint
    enough = math.ceil(float(complaint.split("; ")[1].split()[0]))
    assert vnca(*sized, enough, *FEW).code == 0
    fine = ("--refine", "2", "--style-scale", "0.6", "--out", run / "fine")
    assert vnca(*evaluated, *fine).code == 0
    assert "2 times as fine" in (run / "fine" / "report.html").read_text()
    frame.unlink()
    assert str(frame) in vnca("evaluate", run, *SMALL).complaint


def test_smoke_without_velocity_is_measured_as_far_as_it_goes(
    vnca: Vnca, model: Path, smoke: Path, style: Path, tmp_path: Path
) -> None:
    options = ("--velocity-grid", "none", "--out", tmp_path, "--style", style, *SMALL)
    outcome = vnca("evaluate", model, smoke, *options, "--json")
    assert outcome.code == 0
    measures = json.loads((tmp_path / "report.json").read_text())
    assert json.loads(outcome.out) == measures
    unknown = {name for name, measure in measures.items() if measure["value"] is None}
    assert unknown == {
        *("structure.width", "time.warp_short", "time.warp_long"),
        *("motion.direction", "motion.magnitude", "motion.transport"),
    }
    assert "no velocity" in measures["motion.direction"]["reason"]


def test_a_judge_that_is_not_installed_is_left_out_with_a_reason(
    vnca: Vnca,
    model: Path,
    frame: Path,
    style: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def load(name: str) -> FeatureNetwork:
        if name == "edges":
            raise BackendUnavailableError("features 'edges': not installed")
        return load_network(name)

    monkeypatch.setattr("vnca.recipe.evaluation.load_network", load)
    out = ("--out", tmp_path, "--style", style, "--velocity-grid", "none", *SMALL)
    assert vnca("evaluate", model, frame, *out).code == 0
    measures = json.loads((tmp_path / "report.json").read_text())
    assert measures["style.by_edges"]["value"] is None
    assert measures["style.by_edges"]["reason"] == "features 'edges': not installed"
    assert measures["style.by_efficientnet"]["value"] is not None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--size", "8"), "--size 8"),
        (("--style-scale", "0.1"), "--style-scale 0.1"),
        (("--frames", "70-80"), "70-80"),
    ],
)
def test_what_cannot_be_measured_is_told_in_one_line(
    vnca: Vnca, model: Path, smoke: Path, style: Path, options: tuple[str, ...], message: str
) -> None:
    assert message in vnca("evaluate", model, smoke, "--style", style, *options).complaint


def test_what_is_not_where_it_should_be_is_told_before_long_work(
    vnca: Vnca, model: Path, smoke: Path, style: Path
) -> None:
    unknown = vnca("evaluate", model, smoke, "--style", style).complaint
    assert "how many cells wide its picture was; set --style-scale" in unknown
    assert "'night.png' is; name it with --style" in vnca("evaluate", model, smoke).complaint
    assert "no such file" in vnca("evaluate", model, smoke, "--style", "none.png").complaint
    out = ("--style", style, "--out", style / "report")
    assert "is not a folder" in vnca("evaluate", model, smoke, *out).complaint


def test_a_run_that_tells_no_frame_asks_for_a_sequence(
    vnca: Vnca, model: Path, style: Path
) -> None:
    complaint = vnca("evaluate", model / MODEL_NAME, "--style", style).complaint
    assert "name a sequence" in complaint
