"""The paper's three tables, filled from what the studies found.

Run `python benchmarks/paper/tables.py CSV … [--into FILE.md]`. A cell is what was measured, or what
the paper says, or "not measured"; nothing else. `--into` puts the tables between the marks
`<!-- tables -->` and `<!-- end of tables -->` of a document.
"""

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from vnca.core.errors import FileFormatError
from vnca.core.files import existing_file, whole_file

Rows: TypeAlias = Sequence[dict[str, str]]
MISSING = "not measured"
BEGIN, END = "<!-- tables -->", "<!-- end of tables -->"
TRAITS = (
    "A several views",
    "B coherent in time",
    "C other smoke",
    "D colour and density",
    "E at most 1 min a frame",
    "F training in 12 GB",
    "G meshes",
)
PAPER: dict[str, str] = {
    "TNST": "-+---+-",
    "LNST": "-+---+-",
    "Aurand 2022": "-+--++-",
    "Guo 2021": "+++-+--",
    "Aurand 2022, feed-forward": "+---+--",
    "VNCA": "+++++-+",
}
"""The paper's Table 1 as printed, a sign a trait."""
RUN_AS = {
    "TNST": "tnst",
    "LNST": "lnst",
    "Aurand 2022": "aurand",
    "Aurand 2022, feed-forward": "aurand-forward",
    "VNCA": "vnca",
}
PREFERRED = {
    "TNST": ("463 s", "0.67 %", "n/a", "16.33 %"),
    "LNST": ("10 s", "19.33 %", "15.91 %", "28.57 %"),
    "VNCA": ("0.8 s", "80 %", "84.09 %", "55.10 %"),
}
"""The paper's Table 2: seconds a frame of 200×300×200 on an RTX 3090 Ti, and its user study."""
DRAFT, AUTHORS = "draft", "draft + authors' scaling"


def measured(rows: Rows, study: str, variant: str, measure: str, **where: str) -> str:
    """Mean and deviation over the seeds of one measure, or that it was not measured.

    Rows of several set-ups are never mixed: the last one that is in the tables counts.
    """
    wanted = {"study": study, "variant": variant, "measure": measure, **where}
    found = [row for row in rows if all(row.get(name) == value for name, value in wanted.items())]
    if not found:
        return MISSING
    setup = ("frame", "style", "preset", "iterations", "size", "features", "on")
    last = [found[-1].get(name) for name in setup]
    by_seed = {
        row["seed"]: float(row["value"])
        for row in found
        if [row.get(name) for name in setup] == last
    }
    values = list(by_seed.values())
    spread = f" ± {np.std(values):.2g}" if len(values) > 1 else ""
    return f"{np.mean(values):.3g}{spread}"


def traits(rows: Rows) -> list[str]:
    """Table 1: what each method can, as the paper says (+, −), and what was measured of it."""
    lines = [f"| | {' | '.join(TRAITS)} |", f"|---|{'---|' * len(TRAITS)}"]
    for method, signs in PAPER.items():
        cells = [sign.replace("-", "−") for sign in signs]
        if (name := RUN_AS.get(method)) is None:
            lines.append(f"| {method} (not run: no code is public) | {' | '.join(cells)} |")
            continue
        found = {
            0: ("spread over sides {}", "Spread over sides"),
            1: ("warp error {}", "Warp error, short"),
            4: ("{} s", "Seconds a frame"),
            5: ("{} MB", "Memory, MB"),
        }
        for place, (text, measure) in found.items():
            value = measured(rows, "methods", name, measure)
            cells[place] += f", {text.format(value) if value != MISSING else MISSING}"
        if name == "vnca":
            trained, met = (
                measured(rows, "generalisation", variant, "L_app", on=on)
                for variant, on in (("sequence", "frame 30"), ("unseen", "jets"))
            )
            cells[2] += f", L_app {trained} trained on, {met} on other smoke"
            cells[5] = f"−, {megabytes(measured(rows, 'cost', 'reference', 'training, MB'))}"
            cells[6] += ", see [textures](guide/texture.md#compare)"
        lines.append(f"| {method} | {' | '.join(cells)} |")
    return lines


def megabytes(value: str) -> str:
    """With its unit, if there is a value."""
    return value if value == MISSING else f"{value} MB in training"


def comparison(rows: Rows) -> list[str]:
    """Table 2: seconds a frame and preferences, the paper's, and what we measured beside them."""
    ours = ("Seconds a frame", "Memory, MB", "L_app, around, by edges", "Warp error, short")
    grids = sorted({row["on"] for row in rows if row["study"] == "methods"})
    heads = ["paper: runtime", "quality", "consistency", "motion"]
    heads += [f"ours: {name}" for name in (*ours, "preferences")]
    lines = [f"| | {' | '.join(heads)} |", f"|---|{'---|' * len(heads)}"]
    for method in ("TNST", "LNST", "Aurand 2022", "VNCA"):
        theirs = PREFERRED.get(method, ("not in the table",) + ("–",) * 3)
        values = (measured(rows, "methods", RUN_AS[method], name) for name in ours)
        lines.append(f"| {method} | {' | '.join([*theirs, *values, MISSING])} |")
    where = f"Ours: {', '.join(grids)} cells, on a CPU." if grids else f"Ours: {MISSING} so far."
    where += (
        " Figures on other smoke: [other methods](guide/peers.md#what-a-comparison-shows-so-far)."
    )
    return [*lines, "", where]


def ablations(rows: Rows) -> list[str]:
    """Table 3: what the encoded priors do, the paper's figures and ours in both scalings."""
    paper = {
        "L_dir": ("0.134", "0.083"),
        "L_mag": ("0.295", "0.167"),
        "L_app": ("7.29", "5.42"),
    }
    heads = ("paper, without", "with", "ours, without", "with", "authors' scaling, without", "with")
    lines = [f"| | {' | '.join(heads)} |", f"|---|{'---|' * len(heads)}"]
    asked = [
        (f"{loss} ({by}), velocity encoding, {on}", loss, "velocity", f"{loss}, {by}", {"on": on})
        for on in ("frame", "jets")
        for loss in ("L_dir", "L_mag")
        for by in ("network", "DIS")
    ]
    asked += [("L_app, density encoding", "L_app", "density", "L_app", {"on": "cells in smoke"})]
    for title, loss, study, measure, where in asked:
        cells = [
            measured(rows, study, f"{kind} {study} encoding", measure, preset=preset, **where)
            for preset in (DRAFT, AUTHORS)
            for kind in ("without", "with")
        ]
        lines.append(f"| {title} | {' | '.join([*paper[loss], *cells])} |")
    return lines


def tables(rows: Rows) -> str:
    """All three, as Markdown."""
    parts = [
        "**Table 1**, what methods can. + and − are the paper's; figures are ours, on the "
        "smoke of Table 2, which is smaller.",
        "",
        *traits(rows),
        "",
        "**Table 2**, methods on the *Smoke Jet*. The paper's on an RTX 3090 Ti at 200×300×200.",
        "",
        *comparison(rows),
        "",
        "**Table 3**, what encoded priors do. Lower is better.",
        "",
        *ablations(rows),
    ]
    return "\n".join(parts) + "\n"


def read(paths: Sequence[Path]) -> list[dict[str, str]]:
    """Rows of tables of findings, in their order.

    Raises:
        FileFormatError: If one is missing or no such table.
    """
    rows: list[dict[str, str]] = []
    for path in paths:
        with existing_file(path).open(encoding="utf-8", newline="") as file:
            found = list(csv.DictReader(file))
        if any(not {"study", "variant", "measure", "value"} <= {*row} for row in found):
            raise FileFormatError(f"{path}: not a table of findings")
        rows += found
    return rows


def put_into(path: Path, text: str) -> None:
    """Replace what stands between the marks of a document.

    Raises:
        FileFormatError: If it has no such marks.
    """
    document = existing_file(path).read_text(encoding="utf-8")
    before, mark, rest = document.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not mark or not end:
        raise FileFormatError(f"{path}: expected the marks {BEGIN} and {END}")
    with whole_file(path) as temporary:
        temporary.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("tables", type=Path, nargs="+", metavar="CSV")
    parser.add_argument("--into", type=Path, metavar="FILE.md")
    options = parser.parse_args()
    try:
        text = tables(read(options.tables))
        if options.into is None:
            print(text, end="")
        else:
            put_into(options.into, text)
    except FileFormatError as error:
        parser.exit(2, f"{error}\n")


if __name__ == "__main__":
    main()
