"""What `vnca evaluate` says of the styles of the library, in one table.

    python benchmarks/styles/measure.py SMOKE PICTURES OUT.csv [OPTIONS] [STYLE ...]

SMOKE is a sequence and PICTURES a folder with ours, as `pictures.py` draws them; those by Vincent
van Gogh come with the package or lie here. A row of OUT.csv is a style; one that is there already
is not measured again, so that an interrupted run goes on where it was. At the end the table is
printed in Markdown, with what misses the bounds that the library is to keep in bold.
"""

import argparse
import csv
import sys
import time
from importlib.resources import files
from pathlib import Path
from typing import Any

import vnca
from vnca.metrics.measures import Measure
from vnca.rule.library import SUFFIX, load_style, style_names
from vnca.rule.model import Model

HERE = Path(__file__).parent
MEASURES = {
    "warp_short": "time.warp_short",
    "warp_long": "time.warp_long",
    "flow": "time.flow",
    "direction": "motion.direction",
    "noise_direction": "motion.direction",
    "spread": "views.spread",
    "mass": "density.mass_change",
    "score": "style.score",
    "by_edges": "style.by_edges",
    "by_efficientnet": "style.by_efficientnet",
    "lines": "structure.lines",
    "width": "structure.width",
    "contrast": "structure.contrast",
    "regions": "structure.regions",
    "patches": "structure.patches",
}
"""Columns, and the measures that they hold the value of."""
OF_SMOKE = ("warp_short", "warp_long")
"""Of which the same of the smoke as it comes has a column beside it."""
COLUMNS = (
    "style",
    "frames",
    "refine",
    "seconds",
    "trained_with",
    *MEASURES,
    *(f"{name}_smoke" for name in OF_SMOKE),
)
SPREAD, WARP = 0.08, 1.2
"""The most that the spread may be, and the long warp error over that of the smoke."""


def main() -> None:
    """Measure what is asked, and print the table."""
    asked = _asked()
    known = rows_of(asked.out)
    for name in asked.styles or style_names():
        if name not in known:
            model = trained(name, asked.models)
            style = picture(str(model.training["style"]), asked.pictures)
            known[name] = {"style": name, **measured(model, style, asked, asked.refine)}
            write_rows(asked.out, known)
            print(name, known[name]["seconds"], "s of processor time", file=sys.stderr, flush=True)
    print(table(known))


def trained(name: str, models: Path | None) -> Model:
    """A style of the library, or of a folder in its place."""
    return load_style(name) if models is None else Model.load(models / (name + SUFFIX))


def measured(model: Model, style: Path, asked: argparse.Namespace, refine: int) -> dict[str, str]:
    """A row: what is measured of one model, painted so finely, compared with its picture."""
    begun = time.process_time()
    found = vnca.evaluate(
        model,
        asked.smoke,
        style=style,
        frames=asked.frames,
        refine=refine,
        size=asked.size,
        **read_as(asked),
    )
    by_name = {measure.name: measure for measure in found.measures}
    row = {
        "frames": asked.frames,
        "refine": str(refine),
        "seconds": f"{time.process_time() - begun:.0f}",
        "trained_with": str(model.training["features"]),
    }
    row |= {column: _text(by_name[of].value) for column, of in MEASURES.items()}
    row["noise_direction"] = _text(_more(by_name["motion.direction"], "advected_noise"))
    return row | {
        f"{column}_smoke": _text(by_name[MEASURES[column]].unstylized) for column in OF_SMOKE
    }


def picture(name: str, ours: Path) -> Path:
    """Where the picture of a style lies."""
    places = (ours / name, HERE / name, Path(str(files("vnca.data").joinpath(name))))
    for place in places:
        if place.is_file():
            return place
    sys.exit(f"{ours}: has no {name}; `python benchmarks/styles/pictures.py {ours}` draws it")


def table(rows: dict[str, dict[str, str]]) -> str:
    """In Markdown; bold what misses a bound."""
    lines = [
        "| style | warp short | warp long | over the smoke's | flow, pixels | L_dir | "
        "spread | mass | style score | by edges | regions |",
        "|---" * 11 + "|",
    ]
    for name, row in sorted(rows.items()):
        number = {key: float(value) for key, value in row.items() if key in MEASURES and value}
        cells = (
            name.replace("_", " "),
            f"{number['warp_short']:.2f}",
            *_long_warp(row),
            f"{number['flow']:.1f}",
            f"{number['direction']:.2f}" if "direction" in number else "not measured",
            _bold(f"{number['spread']:.1%}".replace("%", " %"), number["spread"] > SPREAD),
            f"{number['mass']:+.1%}".replace("%", " %"),
            f"{number['score']:.2f}",
            f"{number['by_edges']:.2f}" if "by_edges" in number else "not measured",
            f"{number['regions']:.2f}" if "regions" in number else "not measured",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _long_warp(row: dict[str, str]) -> tuple[str, str]:
    """The error over seven frames, and over that of the smoke; too few frames have none."""
    if not row["warp_long"]:
        return "not measured", "not measured"
    error = float(row["warp_long"])
    over = error / float(row["warp_long_smoke"])
    return f"{error:.2f}", _bold(f"{over:.2f}", over > WARP)


def _bold(text: str, wanted: bool) -> str:
    return f"**{text}**" if wanted else text


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.4f}"


def _more(measure: Measure, name: str) -> float | None:
    value = measure.more.get(name)
    return None if value is None else float(value)


def rows_of(path: Path) -> dict[str, dict[str, str]]:
    """What is measured already, by style."""
    if not path.exists():
        return {}
    with path.open(newline="") as stream:
        return {row["style"]: dict(row) for row in csv.DictReader(stream)}


def write_rows(path: Path, rows: dict[str, dict[str, str]]) -> None:
    """Write them, in the order of their styles."""
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[name] for name in sorted(rows))


def add_smoke(parser: argparse.ArgumentParser, *, frames: str, refine: int) -> None:
    """Arguments that say where smoke and pictures are, and options as `add_reading` has them."""
    parser.add_argument("smoke")
    parser.add_argument("pictures", type=Path)
    add_reading(parser, frames=frames, refine=refine)


def add_models(parser: argparse.ArgumentParser) -> None:
    """The option of `trained`."""
    parser.add_argument("--models", type=Path, help="a folder of others in the library's place")


def runs_parser(about: str | None, *, frames: str, refine: int) -> argparse.ArgumentParser:
    """Of a script about several runs of each picture; options as `add_reading` has them."""
    assert about is not None
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("smoke")
    parser.add_argument("out", type=Path)
    parser.add_argument("runs", nargs="+", help="PICTURE=RUN[=RUN …]")
    add_reading(parser, frames=frames, refine=refine)
    return parser


def add_reading(parser: argparse.ArgumentParser, *, frames: str, refine: int) -> None:
    """Options that say what of the smoke is painted, and how it is read."""
    parser.add_argument("--frames", default=frames)
    parser.add_argument("--refine", type=int, default=refine)
    parser.add_argument("--velocity-units", default="mantaflow")
    parser.add_argument("--fps", type=float, default=24.0)
    parser.add_argument("--time-scale", type=float, default=0.4)
    parser.add_argument("--velocity-scale", type=_number_or_fit, default=0.8)


def add_size(parser: argparse.ArgumentParser) -> None:
    """How large views are, pixels."""
    parser.add_argument("--size", type=int, default=224)


def read_as(asked: argparse.Namespace) -> dict[str, Any]:
    """How smoke is read, as the library has it."""
    names = ("velocity_units", "fps", "time_scale", "velocity_scale")
    return {name: getattr(asked, name) for name in names}


def _number_or_fit(text: str) -> float | str:
    return text if text == "fit" else float(text)


def _asked() -> argparse.Namespace:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_smoke(parser, frames="30-49", refine=1)
    parser.add_argument("out", type=Path)
    parser.add_argument("styles", nargs="*", help="all unless given")
    add_models(parser)
    add_size(parser)
    return parser.parse_intermixed_args()


if __name__ == "__main__":
    main()
