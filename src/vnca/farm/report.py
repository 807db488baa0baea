"""What came of many trainings, as one HTML page that needs nothing else."""

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from vnca.core.errors import VncaError
from vnca.io.picture import fit, read_image
from vnca.metrics.plots import COLOURS, Line, plot
from vnca.metrics.report import figure, page
from vnca.rule.model import MODEL_NAME
from vnca.viewer.training_run import progress

_THUMBNAIL, _PREVIEW = 128, 420
"""Rows and columns of a picture, and columns of what a training shows, at most."""


@dataclass(frozen=True)
class Row:
    """A training in the report.

    Attributes:
        name: What it is called.
        picture: What it learns from.
        setting: What its hyperparameters are called.
        seed: Its seed.
        folder: Its run.
    """

    name: str
    picture: Path
    setting: str
    seed: int
    folder: Path


def report(title: str, frame: Path, rows: Sequence[Row]) -> str:
    """The page: a line a training, with its picture and what it paints; then the losses.

    Args:
        title: What it is called.
        frame: What all were trained on.
        rows: The trainings.
    """
    told = [_told(row.folder) for row in rows]
    pictures = dict.fromkeys(row.picture for row in rows)
    curves = []
    for picture in pictures:
        pairs = [each for each in zip(rows, told, strict=True) if each[0].picture == picture]
        curves += [f"<h2>{escape(picture.name)}</h2>", _curves(pairs)]
    sections = [
        f"<h1>{escape(title)}</h1>",
        f'<div class="facts">frame: {escape(frame.name)}</div>',
        f'<div class="facts">trainings: {len(rows)}, of which {sum(map(_is_done, told))} are done'
        "</div>",
        "<table>",
        "<tr><th>training</th><th>picture</th><th>picture, and what it paints</th>"
        "<th>iterations</th><th>loss</th></tr>",
        *(_line(row, of) for row, of in zip(rows, told, strict=True)),
        "</table>",
        *curves,
        '<p class="note">Losses can be compared where the picture is the same, and settings weigh '
        "the terms of the loss alike.</p>",
    ]
    return page(title, sections)


def _told(folder: Path) -> dict[str, Any]:
    """How far a training is, and its losses."""
    return json.loads(progress(folder))


def _is_done(told: dict[str, Any]) -> bool:
    return 0 < told["iterations"] <= told["iteration"]


def _line(row: Row, told: dict[str, Any]) -> str:
    curve = told["curves"].get("total", [])
    begun = f"{told['iteration']} of {told['iterations']}" if told["iterations"] else "not begun"
    previews = sorted(row.folder.glob("preview_*.png"))
    has_model = (row.folder / MODEL_NAME).exists()
    cells = (
        f"{escape(row.name)}<small>{escape(row.setting)}, seed {row.seed}</small>",
        _picture(row.picture, _THUMBNAIL, _THUMBNAIL),
        _picture(previews[-1], _THUMBNAIL, _PREVIEW) if previews and has_model else "",
        begun,
        f"{curve[-1][1]:.3f}" if curve else "–",
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _picture(path: Path, rows: int, columns: int) -> str:
    """A picture, as far as it can be read."""
    with suppress(VncaError):
        return figure(fit(read_image(path), rows, columns), "")
    return escape(path.name)


def _curves(pairs: Sequence[tuple[Row, dict[str, Any]]]) -> str:
    """The losses of trainings on one picture."""
    shades = list(COLOURS)
    lines = []
    for number, (row, told) in enumerate(pairs):
        curve = told["curves"].get("total", [])
        if curve:
            steps, values = zip(*curve, strict=True)
            label = f"{row.setting}, seed {row.seed}"
            lines.append(Line(label, steps, values, shades[number % len(shades)]))
    return plot(lines, x="iteration", y="loss") if lines else "<p>Nothing has been learned yet.</p>"
