import re
from itertools import pairwise
from xml.etree import ElementTree

import pytest

from vnca.metrics.plots import Line, plot


def drawn(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg)


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in drawn(svg).iter("text")]


def test_a_higher_value_lies_higher_and_a_later_one_further_right() -> None:
    svg = plot([Line("a", [1, 2, 3], [0.1, 0.5, 0.3], "painted")], x="frame", y="share")
    (path,) = [p.get("d", "") for p in drawn(svg).iter("path") if p.get("stroke-width")]
    numbers = [float(n) for n in re.findall(r"[\d.]+", path)]
    across, down = numbers[::2], numbers[1::2]
    assert across == sorted(across)
    assert down[1] < down[2] < down[0]


def test_a_missing_value_leaves_a_gap() -> None:
    svg = plot([Line("a", [1, 2, 3, 4, 5], [1, 2, None, 3, 4], "plain")], x="", y="")
    (path,) = [p.get("d", "") for p in drawn(svg).iter("path") if p.get("stroke-width")]
    assert path.count("M") == 2


def test_lines_without_values_are_left_out_and_a_plot_of_none_is_nothing() -> None:
    assert plot([Line("a", [1], [None], "plain")], x="", y="") == ""
    some = [Line("a", [1], [None], "plain"), Line("b", [1], [2.0], "painted")]
    assert "b" in texts(plot(some, x="", y=""))
    assert "a" not in texts(plot(some, x="", y=""))


def test_labels_do_not_cover_each_other() -> None:
    lines = [Line(str(n), [1, 2], [0.0, 0.5 + n / 1000], "plain") for n in range(5)]
    svg = plot(lines, x="x", y="y")
    heights = sorted(
        float(t.get("y", "")) for t in drawn(svg).iter("text") if t.text in set("01234")
        and t.get("text-anchor") == "start"
    )  # fmt: skip
    assert len(heights) == 5
    assert min(b - a for a, b in pairwise(heights)) > 10


@pytest.mark.parametrize("values", [[0.0, 0.0], [-1e-7, 1e-7], [-3e5, 2e6], [5.0, 5.0]])
def test_any_range_has_axes_that_hold_it(values: list[float]) -> None:
    svg = plot([Line("a", [1, 2], values, "painted")], x="frame", y="share")
    ticks = [t.text for t in drawn(svg).iter("text") if t.get("text-anchor") == "end"]
    numbers = [float(tick or "") for tick in ticks]
    assert 2 <= len(numbers) <= 12
    assert numbers[0] <= min(values)
    assert max(values) <= numbers[-1]


def test_words_are_escaped() -> None:
    svg = plot([Line("<script>", [1, 2], [1, 2], "plain")], x="a & b", y='"')
    assert "<script>" not in svg
    assert "<script>" in texts(svg)
