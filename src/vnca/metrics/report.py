"""A survey as one HTML page that needs nothing else: no script, font or picture from elsewhere."""

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from io import BytesIO

import numpy as np
from PIL import Image

from vnca.core import AnyArray, FloatArray
from vnca.io.picture import fit, to_srgb8
from vnca.metrics import RING, Survey, TextureMotion
from vnca.metrics.coherence import LONG
from vnca.metrics.measures import Measure
from vnca.metrics.plots import Line, Shade, plot
from vnca.metrics.setup import Pair, Seen
from vnca.metrics.style import StyleDistances

BACKGROUND = (0.01, 0.01, 0.01)
"""Linear colour behind the smoke."""
_STYLE_SIZE = 384
_SHADES: dict[str, Shade] = {"palette": "third", "texture": "other", "spectrum": "plain"}
_POLES: tuple[tuple[int, str, Shade], ...] = ((1, "above", "other"), (-1, "below", "third"))
_FAINTEST, _MARGIN = 0.05, 4  # opacity and pixels: to what a strip is cropped
_STEEPEST = 0.5  # difference of perceived colours that is shown white


def report(
    survey: Survey, listed: Iterable[Measure], picture: FloatArray, facts: Mapping[str, str]
) -> str:
    """The page.

    Args:
        survey: What was found.
        listed: The measures of it.
        picture: The style picture, linear RGB `[r, c, 3]`.
        facts: What was measured, on what and by what: a line each.
    """
    last = survey.strip[-1]
    sections = [
        f"<h1>{escape(facts['title'])}</h1>",
        "".join(
            f'<div class="facts">{escape(name)}: {escape(value)}</div>'
            for name, value in facts.items()
            if name != "title"
        ),
        '<div class="first">',
        figure(fit(picture, _STYLE_SIZE, _STYLE_SIZE), "the picture"),
        figure(_shown(last.pair.painted), f"frame {last.frame}, painted"),
        figure(_shown(last.pair.plain), f"frame {last.frame} as it comes, lit from above"),
        "</div>",
        _table(listed),
        *_style(survey),
        *_views(survey),
        *_time(survey),
        *_motion(survey.turn.texture, survey.turn.frame),
        *_density(survey),
    ]
    return page(facts["title"], sections)


def page(title: str, sections: Iterable[str]) -> str:
    """A page of sections in HTML, which needs nothing else."""
    style = files("vnca.metrics").joinpath("report.css").read_text()
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<link rel="icon" href="data:,">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        + "\n".join(sections)
        + "\n</body>\n</html>\n"
    )


def _table(found: Iterable[Measure]) -> str:
    rows = [
        "<tr><th></th><th>painted</th><th>unstylized</th><th>better</th></tr>",
        *(
            f"<tr><td>{escape(measure.title)}<small>{escape(measure.meaning)}"
            f"{_why_not(measure)}</small></td>"
            f'<td class="number">{_number(measure.value)}</td>'
            f'<td class="number">{_number(measure.unstylized)}</td>'
            f'<td class="unit">{escape(measure.better or "as you like")}</td></tr>'
            for measure in found
        ),
    ]
    return f"<table>{''.join(rows)}</table>"


def _why_not(measure: Measure) -> str:
    return f" Not measured: {escape(measure.reason)}." if measure.value is None else ""


def _style(survey: Survey) -> Iterable[str]:
    yield "<h2>Style</h2>"
    yield (
        "<p>Three measures that training never used compare what is opaque in a view with the "
        "picture. Each is in units of the picture's own variation, and has two ends: the grey "
        "smoke (0), and parts cut out of the picture in the shape of the smoke (1).</p>"
    )
    names = {
        "palette": "Colours, wherever they are",
        "texture": "What small filters see, at three sizes",
        "spectrum": "How much there is of coarse and fine",
    }
    parts = list(survey.style.values())
    rows = ["<tr><th></th><th>painted</th><th>unstylized</th><th>cut-outs</th><th>score</th></tr>"]
    for at, name in enumerate(StyleDistances._fields):
        painted = np.mean([distances[at] for part in parts for distances in part.painted])
        plain, cutout = (
            np.mean([getattr(part, kind)[at] for part in parts]) for kind in ("plain", "cutout")
        )
        closed = np.mean([part.by_measure[name] for part in parts])
        cells = (painted, plain, cutout, closed)
        rows.append(
            f"<tr><td>{name.capitalize()}<small>{names[name]}</small></td>"
            + "".join(f'<td class="number">{_number(float(cell))}</td>' for cell in cells)
            + "</tr>"
        )
    yield f"<table>{''.join(rows)}</table>"
    yield plot(
        [
            Line(
                "all together",
                [*survey.style],
                [part.normalised_score for part in parts],
                "painted",
            ),
            *(
                Line(name, [*survey.style], [part.by_measure[name] for part in parts], shade)
                for name, shade in _SHADES.items()
            ),
        ],
        x="frame",
        y="normalised style score",
    )


def _views(survey: Survey) -> Iterable[str]:
    turn = survey.turn
    yield "<h2>Views</h2>"
    yield f"<p>Frame {turn.frame} from all sides, and from above and below.</p>"
    shown = [*turn.ring[: len(RING) : 4], turn.ring[len(RING)], turn.ring[-1]]
    yield _grid(
        [
            [
                (
                    _shown(seen.painted),
                    f"{seen.viewpoint.azimuth:g}°, {_from(seen.viewpoint.elevation)}",
                )
                for seen in shown
            ],
            [(_shown(seen.plain), "") for seen in shown],
        ],
        _around_smoke(shown),
    )
    shares = dict(zip(turn.style_score.viewpoints, turn.style_score.shares, strict=True))
    level = {viewpoint: share for viewpoint, share in shares.items() if viewpoint in RING}
    lines = [Line("all around", [s.azimuth for s in level], [*level.values()], "painted")]
    for sign, label, shade in _POLES:
        some = {s: v for s, v in shares.items() if s not in RING and s.elevation * sign > 0}
        lines.append(
            Line(f"from {label}", [s.azimuth for s in some], [*some.values()], shade, "dots")
        )
    yield plot(lines, x="azimuth, degrees", y="normalised style score")


def _time(survey: Survey) -> Iterable[str]:
    if not survey.steps:
        return
    yield "<h2>Time</h2>"
    yield (
        "<p>From one place, frame by frame. The last row shows where a picture disagrees with the "
        "one before it once each pixel has been followed along the smoke's velocity: black where "
        "the paint was advected, bright where it was not.</p>"
    )
    rows = [
        [(_shown(still.pair.painted), str(still.frame)) for still in survey.strip],
        [(_shown(still.pair.plain), "") for still in survey.strip],
    ]
    if any(still.difference is not None for still in survey.strip):
        rows.append(
            [
                (_heat(still.difference, still.pair.painted.opacity.shape), "")
                for still in survey.strip
            ]
        )
    yield _grid(rows, _around_smoke([still.pair for still in survey.strip]))
    frames = [step.frame for step in survey.steps]
    for title, errors in (
        ("difference from the frame before", [step.short for step in survey.steps]),
        (f"difference from {LONG} frames before", [step.long for step in survey.steps]),
    ):
        yield plot(
            [
                Line("painted", frames, [e and e.painted for e in errors], "painted"),
                Line(
                    "as if it stood still",
                    frames,
                    [e and e.unmoved for e in errors],
                    "painted",
                    "dashes",
                ),
                Line("unstylized", frames, [e and e.plain for e in errors], "plain"),
            ],
            x="frame",
            y=title,
        )
    yield (
        '<p class="note">0: the same; 1: as different as pixels that have nothing to do with each '
        "other. Paint that is advected lies below the dashed line.</p>"
    )


def _motion(texture: TextureMotion | str, frame: int) -> Iterable[str]:
    yield "<h2>Motion</h2>"
    if isinstance(texture, str):
        yield f"<p>Not measured: {escape(texture)}.</p>"
        return
    yield (
        f"<p>The smoke of frame {frame} is held still while the rule goes on painting, so that all "
        "that moves is texture. Beside it, noise that the velocity carries exactly, as the same "
        "estimators see it, and a texture that drifts rigidly.</p>"
    )
    heads = ("", "L_dir, network", "L_dir, DIS", "L_mag, network", "L_mag, DIS", "transport")
    rows = [f"<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"]
    for label, motion in (("the rule", texture.rule), ("advected noise", texture.carried)):
        values = [
            getattr(motion, what)[by]
            for what in ("direction", "magnitude")
            for by in ("network", "dis")
        ]
        rows.append(_row(label, [*values, motion.transport]))
    direction, magnitude = texture.drift
    rows.append(_row("rigid drift", [direction, direction, magnitude, magnitude, None]))
    yield f"<table>{''.join(rows)}</table>"
    yield (
        '<p class="note">L_mag in pixels a frame; the smoke moves by '
        f"{texture.rule.speed:.2f} on average.</p>"
    )


def _density(survey: Survey) -> Iterable[str]:
    yield "<h2>Density</h2>"
    yield "<p>What painting does to the smoke itself, as a share of its mass.</p>"
    yield plot(
        [
            Line("moved", survey.frames, [c.moved for c in survey.density], "painted"),
            Line("change of mass", survey.frames, [c.mass_change for c in survey.density], "other"),
        ],
        x="frame",
        y="share of the mass",
    )


def _row(label: str, values: Sequence[float | None]) -> str:
    cells = "".join(f'<td class="number">{_number(value)}</td>' for value in values)
    return f"<tr><td>{escape(label)}</td>{cells}</tr>"


def _grid(rows: Sequence[Sequence[tuple[AnyArray, str]]], inside: tuple[slice, slice]) -> str:
    """Pictures with captions, of each the part that is wanted."""
    columns = len(rows[0])
    cells = "".join(figure(picture[inside], caption) for row in rows for picture, caption in row)
    return f'<div class="strip" style="grid-template-columns:repeat({columns},1fr)">{cells}</div>'


def _around_smoke(pairs: Iterable[Pair]) -> tuple[slice, slice]:
    """The rows and columns in which some picture shows smoke, with a little margin."""
    anywhere = np.logical_or.reduce([pair.painted.opacity > _FAINTEST for pair in pairs])
    if not anywhere.any():
        return slice(None), slice(None)
    at = np.argwhere(anywhere)
    lower, upper = np.maximum(at.min(0) - _MARGIN, 0), at.max(0) + _MARGIN + 1
    return slice(lower[0], upper[0]), slice(lower[1], upper[1])


def figure(picture: AnyArray, caption: str) -> str:
    """A picture, linear RGB `[r, c, 3]`, with what is written below it, if there is something."""
    encoded = BytesIO()
    Image.fromarray(to_srgb8(picture)).save(encoded, "WEBP", quality=90, method=4)
    data = base64.b64encode(encoded.getvalue()).decode()
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return (
        f'<figure><img alt="{escape(caption)}" src="data:image/webp;base64,{data}">{below}</figure>'
    )


def _shown(seen: Seen) -> FloatArray:
    return seen.over(BACKGROUND)


def _heat(difference: FloatArray | None, shape: tuple[int, ...]) -> AnyArray:
    """A difference as light: black, red, yellow, white."""
    heat = np.zeros(shape) if difference is None else 3 * difference / _STEEPEST
    return np.stack([heat, heat - 1, heat - 2], axis=-1).clip(0, 1)


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if value == 0 or abs(value) >= 100 else f"{value:.3f}".replace("-", "−")


def _from(elevation: float) -> str:
    if abs(elevation) < 45:
        return "level"
    return "from above" if elevation > 0 else "from below"
