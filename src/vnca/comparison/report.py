"""The comparison as one HTML page that needs nothing else, and its films."""

import base64
from collections.abc import Callable, Mapping, Sequence
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from vnca.comparison.measure import JUDGES, Result
from vnca.core import AnyArray, FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.io.film import FilmWriter

_GAP = 4  # pixels between films
_PICTURE = 384
_ROWS: tuple[tuple[str, str, Callable[[Result], float | None]], ...] = (
    ("Seconds a frame", "without training", lambda r: r.contender.seconds),
    ("Training, seconds", "once for all frames", lambda r: r.contender.training),
    ("Memory, MB", "the most it took", lambda r: r.contender.peak_mb),
    *(
        (
            f"L_app, front, by {name}",
            "lower is nearer to the picture",
            lambda r, n=name: r.front.get(n),
        )
        for name in JUDGES
    ),
    *(
        (
            f"L_app, around, by {name}",
            "mean over eight sides",
            lambda r, n=name: r.around.get(n),
        )
        for name in JUDGES
    ),
    ("Spread over sides", "deviation of that over its mean", lambda r: r.spread),
    (
        "Warp error, short",
        "0 if the picture moves with the smoke, 1 if unrelated",
        lambda r: r.short,
    ),
    ("Warp error, long", "the same over seven frames", lambda r: r.long),
    ("Difference of flows", "pixels a frame, against the smoke's own", lambda r: r.flow),
    ("Density changed", "share of the mass", lambda r: r.moved),
    ("Mass gained", "share", lambda r: r.mass),
)


def table(results: Sequence[Result]) -> str:
    """What was measured, as text: a column a method."""
    names = [result.contender.name for result in results]
    width = max(10, *(len(name) + 2 for name in names))
    lines = [f"{'':30}" + "".join(f"{name:>{width}}" for name in names)]
    for title, _, value in _ROWS:
        cells = "".join(f"{_number(value(result)):>{width}}" for result in results)
        lines.append(f"{title:30}{cells}")
    return "\n".join(lines)


def as_json(results: Sequence[Result]) -> dict[str, dict[str, float | None]]:
    """The same by method and measure."""
    return {
        result.contender.name: {title: value(result) for title, _, value in _ROWS}
        for result in results
    }


def write_films(results: Sequence[Result], folder: Path, fps: float) -> list[Path]:
    """A film of each, and one of all side by side, `films.mp4`; the latter is the last."""
    paths = []
    for result in results:
        path = folder / f"{result.contender.name}.mp4"
        with FilmWriter(path, fps) as film:
            for picture in result.film:
                film.add(_shown(_even(picture)))
        paths.append(path)
    with FilmWriter(folder / "films.mp4", fps) as film:
        for pictures in zip(*(result.film for result in results), strict=True):
            film.add(_shown(_even(_side_by_side(pictures))))
    return [*paths, folder / "films.mp4"]


def report(
    results: Sequence[Result], picture: FloatArray, films: Sequence[Path], facts: Mapping[str, str]
) -> str:
    """The page.

    Args:
        results: What was found.
        picture: Grey, `[r, c]` as perceived.
        films: One of each, in the same order, and perhaps more.
        facts: What was compared, a line each.
    """
    style = files("vnca.metrics").joinpath("report.css").read_text()
    heads = "".join(f"<th>{escape(result.contender.name)}</th>" for result in results)
    rows = [
        f"<tr><td>{escape(title)}<small>{escape(meaning)}</small></td>"
        + "".join(f'<td class="number">{_number(value(result))}</td>' for result in results)
        + "</tr>"
        for title, meaning, value in _ROWS
    ]
    shown = "".join(
        f'<figure><video src="{as_data(path, "video/mp4")}" autoplay loop muted playsinline '
        f'style="width:100%"></video><figcaption>{escape(result.contender.name)}</figcaption>'
        "</figure>"
        for result, path in zip(results, films, strict=False)
    )
    told = "".join(
        f'<div class="facts">{escape(name)}: {escape(value)}</div>'
        for name, value in facts.items()
        if name != "title"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(facts['title'])}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"<h1>{escape(facts['title'])}</h1>{told}\n"
        f'<div class="first"><figure><img alt="the picture" src="{picture_data(picture)}">'
        "<figcaption>the picture</figcaption></figure></div>\n"
        f'<div class="strip" style="grid-template-columns:repeat({len(results)},1fr)">{shown}</div>'
        f"\n<table><tr><th></th>{heads}</tr>{''.join(rows)}</table>\n"
        '<p class="note">Grey for all. Of methods that change density only, the picture is the '
        "light that it gives, as they saw it; of others, the brightness of a film of them. Pixels "
        "where the smoke, as it comes, is opaque are compared: the same for all. The rule of vnca "
        "is trained with efficientnet, the other methods compare by a VGG: each network favours "
        "whom it trained.</p>\n</body>\n</html>\n"
    )


def as_data(path: Path, kind: str) -> str:
    """A file as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def picture_data(picture: FloatArray) -> str:
    """A grey picture, `[r, c]` in 0–1, as an address that holds it."""
    encoded = BytesIO()
    image = Image.fromarray((picture * 255).round().astype(np.uint8))
    image.thumbnail((_PICTURE, _PICTURE))
    image.save(encoded, "PNG")
    return f"data:image/png;base64,{base64.b64encode(encoded.getvalue()).decode()}"


def _side_by_side(pictures: Sequence[FloatArray]) -> FloatArray:
    gap = np.full((len(pictures[0]), _GAP), 0.15, np.float32)
    columns = [part for picture in pictures for part in (picture, gap)]
    return np.concatenate(columns[:-1], axis=1)


def _even(picture: FloatArray) -> FloatArray:
    """With even sides, which films want."""
    rows, columns = picture.shape
    return np.pad(picture, ((0, rows % 2), (0, columns % 2)))


def _shown(picture: FloatArray) -> AnyArray:
    return np.repeat(srgb_to_linear(picture)[..., None], 3, axis=-1)


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
