"""Charts with logarithmic axes, written as SVG: small, and a diff shows which point moved."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from math import ceil, floor, log10

WIDTH, HEIGHT = 520, 400
LEFT, RIGHT, TOP, BOTTOM = 64, 36, 56, 48
COLOURS = {
    "plain": "#7f7f7f",
    "compile": "#bcbd22",
    "onnx": "#9467bd",
    "reference": "#1f77b4",
    "native": "#d62728",
    "triton": "#2ca02c",
}
LARGE = 'font-size="14" font-weight="bold"'
SMALL = 'font-size="11" fill="#555"'
GRID = 'stroke="#ddd"'

Point = tuple[float, float]


@dataclass
class Chart:
    """One pair of axes.

    Attributes:
        title: Above it, with `notes`, a line each.
        x: Label of the axis, and the least and the greatest value.
        y: As `x`.
    """

    title: str
    notes: Sequence[str]
    x: tuple[str, float, float]
    y: tuple[str, float, float]
    _shapes: list[str] = field(default_factory=list)

    def line(self, points: Iterable[Point], colour: str, *, dashed: bool = False) -> None:
        """A line through points."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._at, points))
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        self._shapes.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"{dash}/>'
        )

    def dot(self, point: Point, colour: str, *, hollow: bool = False) -> None:
        """A point."""
        x, y = self._at(point)
        fill = "white" if hollow else colour
        self._shapes.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}" stroke="{colour}"/>'
        )

    def text(self, point: Point, words: str, *, anchor: str = "start", up: float = 0) -> None:
        """Words beside a point, `up` pixels above it."""
        x, y = self._at(point)
        aside = {"start": 8, "end": -8, "middle": 0}[anchor]
        self._shapes.append(
            f'<text {SMALL} x="{x + aside:.1f}" y="{y + 4 - up:.1f}" '
            f'text-anchor="{anchor}">{escape(words)}</text>'
        )

    def parts(self) -> list[str]:
        """The elements of the chart, a line of SVG each."""
        lines = [
            f'<text font-size="14" font-weight="bold" x="{LEFT}" y="16">{escape(self.title)}</text>'
        ]
        lines += [
            f'<text {SMALL} x="{LEFT}" y="{32 + 14 * i}">{escape(note)}</text>'
            for i, note in enumerate(self.notes)
        ]
        for value in _ticks(*self.x[1:]):
            x, _ = self._at((value, self.y[1]))
            lines.append(
                f'<line {GRID} x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{HEIGHT - BOTTOM}"/>'
                f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">'
                f"{_number(value)}</text>"
            )
        for value in _ticks(*self.y[1:]):
            _, y = self._at((self.x[1], value))
            lines.append(
                f'<line {GRID} x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - RIGHT}" y2="{y:.1f}"/>'
                f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{_number(value)}</text>'
            )
        middle = (TOP + HEIGHT - BOTTOM) / 2
        return [
            *lines,
            f'<rect fill="none" stroke="#888" x="{LEFT}" y="{TOP}" width="{WIDTH - LEFT - RIGHT}" '
            f'height="{HEIGHT - TOP - BOTTOM}"/>',
            f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 8}" text-anchor="middle">'
            f"{escape(self.x[0])}</text>",
            f'<text transform="translate(16 {middle}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y[0])}</text>",
            *self._shapes,
        ]

    def _at(self, point: Point) -> Point:
        x, y = (
            log10(value / least) / log10(most / least)
            for value, (_, least, most) in zip(point, (self.x, self.y), strict=True)
        )
        return LEFT + x * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - y * (HEIGHT - TOP - BOTTOM)


def page(charts: Sequence[Chart]) -> str:
    """An SVG file with the charts, two abreast."""
    columns = min(2, len(charts))
    width, height = columns * WIDTH, ceil(len(charts) / columns) * HEIGHT
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" font-family="sans-serif" font-size="12" fill="#222">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for number, chart in enumerate(charts):
        row, column = divmod(number, columns)
        lines.append(f'<g transform="translate({column * WIDTH} {row * HEIGHT})">')
        lines += chart.parts()
        lines.append("</g>")
    return "\n".join([*lines, "</svg>"]) + "\n"


def around(values: Iterable[float]) -> tuple[float, float]:
    """The powers of ten around some values."""
    logs = [log10(value) for value in values]
    return 10.0 ** floor(min(logs)), 10.0 ** max(ceil(max(logs)), floor(min(logs)) + 1)


def _ticks(least: float, most: float) -> list[float]:
    return [10.0**n for n in range(ceil(log10(least) - 1e-9), floor(log10(most) + 1e-9) + 1)]


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1 else f"{value:g}"
