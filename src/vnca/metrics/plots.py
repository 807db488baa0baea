"""Line plots as SVG, to be read inside a page without anything else."""

import math
from collections.abc import Sequence
from html import escape
from typing import Literal, NamedTuple

import numpy as np

WIDTH, HEIGHT = 640, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 150, 26, 38
_LABEL_GAP = 15  # between the middles of two labels, so that none covers another
_INK, _RULE = "#6b6862", "#dedad2"
_FONT = "system-ui, -apple-system, 'Segoe UI', 'Helvetica Neue', sans-serif"

Shade = Literal["painted", "plain", "other", "third"]
COLOURS: dict[Shade, str] = {
    "painted": "#b5481f",
    "plain": "#7d7a74",
    "other": "#2f6690",
    "third": "#a98a1c",
}


class Line(NamedTuple):
    """A line of a plot.

    Attributes:
        label: Written at its end.
        x: In ascending order.
        y: As many; None leaves a gap.
        shade: Its colour, by what it stands for.
        kind: How it is drawn.
    """

    label: str
    x: Sequence[float]
    y: Sequence[float | None]
    shade: Shade
    kind: Literal["line", "dashes", "dots"] = "line"


def plot(lines: Sequence[Line], *, x: str, y: str, least: float | None = 0.0) -> str:
    """Lines over one axis, each with its label at its right end.

    Args:
        lines: What to draw; those without any value are left out.
        x: What the horizontal axis says.
        y: What the vertical axis says.
        least: A value that the vertical axis holds in any case.
    """
    lines = [line for line in lines if any(value is not None for value in line.y)]
    if not lines:
        return ""
    known = [value for line in lines for value in line.y if value is not None]
    places = [place for line in lines for place in line.x]
    low, high = min(places), max(places)
    levels = _ticks(*_range([*known, *([] if least is None else [least])]))
    bottom, top = levels[0], levels[-1]

    def across(value: float) -> float:
        return _LEFT + (value - low) / ((high - low) or 1) * (WIDTH - _LEFT - _RIGHT)

    def up(value: float) -> float:
        return HEIGHT - _BOTTOM - (value - bottom) / (top - bottom) * (HEIGHT - _TOP - _BOTTOM)

    right, floor = WIDTH - _RIGHT, HEIGHT - _BOTTOM
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(y)} over {escape(x)}" '
        f'font-family="{_FONT}" font-size="11" fill="none" stroke-linejoin="round">'
    ]
    for level in levels:
        at = up(level)
        parts.append(f'<path d="M{_LEFT} {at:.1f}H{right}" stroke="{_RULE}"/>')
        parts.append(_text(_LEFT - 8, at + 4, f"{level:g}", "end"))
    parts += [
        _text(across(place), floor + 18, f"{place:g}", "middle")
        for place in (_ticks(low, high) if high > low else [low])
        if low <= place <= high
    ]
    parts.append(_text((_LEFT + right) / 2, HEIGHT - 4, x, "middle"))
    parts.append(_text(_LEFT, _TOP - 12, y, "start"))
    for line in lines:
        points = [
            None if value is None else (across(place), up(value))
            for place, value in zip(line.x, line.y, strict=True)
        ]
        parts.append(_drawn(points, line))
    ends = [up([value for value in line.y if value is not None][-1]) for line in lines]
    for line, at in zip(lines, _apart(ends), strict=True):
        parts.append(_text(right + 10, at + 4, line.label, "start", COLOURS[line.shade]))
    return "".join(parts) + "</svg>"


def _drawn(points: Sequence[tuple[float, float] | None], line: Line) -> str:
    there = [point for point in points if point is not None]
    if line.kind == "dots" or len(there) == 1:
        return "".join(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{COLOURS[line.shade]}"/>'
            for x, y in there
        )
    dashes = ' stroke-dasharray="2 4"' if line.kind == "dashes" else ""
    return f'<path d="{_path(points)}" stroke="{COLOURS[line.shade]}" stroke-width="2"{dashes}/>'


def _path(points: Sequence[tuple[float, float] | None]) -> str:
    commands, pen = [], "M"
    for point in points:
        if point is None:
            pen = "M"
            continue
        commands.append(f"{pen}{point[0]:.1f} {point[1]:.1f}")
        pen = "L"
    return "".join(commands)


def _text(x: float, y: float, text: str, anchor: str, colour: str = _INK) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text {place} fill="{colour}">{escape(text)}</text>'


def _apart(heights: Sequence[float]) -> list[float]:
    """Heights near those given at which labels do not cover each other, in the same order."""
    placed, last = dict.fromkeys(range(len(heights)), 0.0), -math.inf
    for at in np.argsort(heights, kind="stable").tolist():
        last = placed[at] = max(heights[at], last + _LABEL_GAP)
    beyond = max(0.0, last - (HEIGHT - _BOTTOM))
    return [placed[at] - beyond for at in range(len(heights))]


def _range(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers that reach from one value to another, four to eight of them."""
    rough = (high - low) / 5
    power = 10 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(k * step, 12) for k in range(first, last + 1)]
