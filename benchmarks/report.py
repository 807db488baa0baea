"""Draws what was measured and puts it into `docs/kernels.md`: no figure there is typed by hand.

Run `python benchmarks/report.py`. It reads the tables in `benchmarks/results`, writes
`docs/images/roofline.svg` and `docs/images/occupancy.svg`, and replaces what lies between the
markers in the document. What has no row is said not to be measured.
"""

import argparse
import csv
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from chart import COLOURS, Chart, around, page
from vnca.bench.contenders import DTYPES, PROBABILITY
from vnca.bench.step import PEAKS, needed_bytes, needed_flop

ROOT = Path(__file__).parents[1]
Row = dict[str, str]
NOT_MEASURED = "Not measured."


def read(path: Path) -> list[Row]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def grouped(rows: Iterable[Row], *columns: str) -> dict[tuple[str, ...], list[Row]]:
    groups: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in rows:
        groups[tuple(row[column] for column in columns)].append(row)
    return groups


def latest(rows: Sequence[Row], case: Sequence[str]) -> list[list[Row]]:
    """The rows of the last run of each case: only those can be compared."""
    return [[*grouped(found, "date").values()][-1] for found in grouped(rows, *case).values()]


STEP_CASE = ("device", "threads", "grid", "hidden", "occupancy", "dtype")
SWEEP_CASE = ("device", "threads", "grid", "hidden", "dtype")


def cells(row: Row) -> float:
    x, y, z = map(int, row["grid"].split("x"))
    return x * y * z * float(row["occupancy"])


def intensity(row: Row) -> float:
    """Needed floating-point operations a needed byte."""
    size = DTYPES[row["dtype"]].itemsize
    part = row["pass"]
    return PROBABILITY * needed_flop(int(row["hidden"]))[part] / needed_bytes(size)[part]


def roofline(rows: Sequence[Row]) -> list[Chart]:
    """A chart for each device and type of number: the largest case measured there."""
    charts = []
    for runs in grouped(rows, "device", "threads", "dtype").values():
        run = max(latest(runs, STEP_CASE), key=lambda found: cells(found[0]))
        first = run[0]
        peak, copy = float(first["peak_gflops"]), float(first["copy_gbs"])
        ridge = peak / copy
        left, right = around([ridge / 10, ridge * 10, *map(intensity, run)])
        low, high = around([*(float(row["gflops"]) for row in run), peak])
        low = min(low, left * copy)
        chart = Chart(
            f"{first['device']}, {first['dtype']}",
            [
                f"{first['grid']} cells, {float(first['occupancy']):.0%} alive, hidden "
                f"{first['hidden']}",
                "full: forward, hollow: with or only backward",
            ],
            ("FLOP a byte that must be moved", left, right),
            ("GFLOP/s", low, high),
        )
        chart.line([(left, left * copy), (ridge, peak), (right, peak)], "#222")
        what = PEAKS[first["peak_of"]]
        chart.text((right, peak), f"{what} {peak:,.0f} GFLOP/s", anchor="end", up=10)
        slope = (left * ridge) ** 0.5
        chart.text((slope, slope * copy), f"copy {copy:,.0f} GB/s", up=-6)
        for row in run:
            at = intensity(row), float(row["gflops"])
            chart.dot(at, COLOURS[row["backend"]], hollow=row["pass"] != "forward")
            if row["pass"] == "forward":
                chart.text(at, f"{row['backend']} {float(row['share_of_peak']):.1%}", anchor="end")
        charts.append(chart)
    return charts


def occupancy(rows: Sequence[Row]) -> list[Chart]:
    """A chart for each device: time of a step against the active cells."""
    charts = []
    for run in latest(rows, SWEEP_CASE):
        first = run[0]
        times = [cells(row) * float(row["ns_per_cell"]) / 1e6 for row in run]
        chart = Chart(
            f"{first['device']}, {first['dtype']}",
            [
                f"one step in a box of {first['grid']} cells, hidden {first['hidden']}",
                "full: forward, hollow: with or only backward; dashed: in proportion",
            ],
            ("cells that live", *around(map(cells, run))),
            ("milliseconds", *around(times)),
        )
        for (backend, part), found in grouped(run, "backend", "pass").items():
            points = [(cells(row), cells(row) * float(row["ns_per_cell"]) / 1e6) for row in found]
            slope, off = proportional(points)
            chart.line([(x, slope * x) for x, _ in points], COLOURS[backend], dashed=True)
            for point in points:
                chart.dot(point, COLOURS[backend], hollow=part != "forward")
            words, middle = f"{backend} {part}: within {off:.0%}", points[len(points) // 2]
            if part == "forward":
                chart.text(middle, words, up=-12)
            else:
                chart.text(middle, words, anchor="end", up=12)
        charts.append(chart)
    return charts


def proportional(points: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The y per x that fits best for its worst point, and how far off that is, relative."""
    rates = [y / x for x, y in points]
    slope = 2 * max(rates) * min(rates) / (max(rates) + min(rates))
    return slope, max(abs(rate / slope - 1) for rate in rates)


def step_table(rows: Sequence[Row]) -> list[str]:
    lines = []
    for run in latest(rows, STEP_CASE):
        first = run[0]
        plain = {r["pass"]: float(r["ns_per_cell"]) for r in run if r["backend"] == "plain"}
        lines += [
            f"**{first['grid']} cells, {float(first['occupancy']):.0%} alive, hidden "
            f"{first['hidden']}, {first['dtype']}**: {first['device']}, {first['threads']} "
            f"threads, torch {first['torch']}; {PEAKS[first['peak_of']]} "
            f"{first['peak_gflops']} GFLOP/s, copy "
            f"{first['copy_gbs']} GB/s ({first['date']})",
            "",
            "| backend | pass | ns an active cell | of peak | of copy | MB | against `plain` |",
            "|---|---|---|---|---|---|---|",
        ]
        for row in run:
            took = float(row["ns_per_cell"])
            gain = f"{plain[row['pass']] / took:.1f}×" if row["pass"] in plain else ""
            lines.append(
                f"| {row['backend']} | {row['pass']} | {took:.4g} | "
                f"{float(row['share_of_peak']):.1%} | {float(row['share_of_copy']):.1%} | "
                f"{row['peak_mb']} | {gain} |"
            )
        lines.append("")
    return lines


def occupancy_table(rows: Sequence[Row]) -> list[str]:
    lines = []
    for run in latest(rows, SWEEP_CASE):
        for (backend, part), found in grouped(run, "backend", "pass").items():
            points = [(cells(row), cells(row) * float(row["ns_per_cell"])) for row in found]
            near = min(found, key=lambda row: abs(float(row["occupancy"]) - 0.15))
            share = cells(near) * float(near["ns_per_cell"]) / max(points)[1]
            lines.append(
                f"- {run[0]['device']}, {run[0]['grid']}, {backend} {part}: in proportion within "
                f"{proportional(points)[1]:.0%}; with {float(near['occupancy']):.1%} alive "
                f"{share:.3f} of what most cells cost."
            )
    return [*lines, ""]


def seconds_table(rows: Sequence[Row], case: Sequence[str], columns: Sequence[str]) -> list[str]:
    """A table for each case of the rows of `vnca bench train` or `stylize`."""
    lines = []
    for run in latest(rows, case):
        told = ", ".join(f"{name} {run[0][name]}" for name in case)
        lines += [
            f"**{told}** ({run[0]['date']})",
            "",
            f"| {' | '.join(columns)} |",
            f"|{'---|' * len(columns)}",
            *(f"| {' | '.join(row[column] for column in columns)} |" for row in run),
            "",
        ]
    return lines


def kernels_table(rows: Sequence[Row]) -> list[str]:
    """What each Triton kernel takes of a multiprocessor, on each generation of GPUs."""
    if not rows:
        return []
    lines = [
        "Registers of a thread and shared memory of a program in KB, with Triton "
        f"{rows[0]['triton']}; nothing spills:",
        "",
        "| kernel | numbers | warps | sm_80 | sm_90 | sm_120 |",
        "|---|---|---|---|---|---|",
    ]
    for (kernel, numbers), found in grouped(rows, "kernel", "numbers").items():
        by_capability = {row["capability"]: row for row in found}
        taken = [
            f"{row['registers']}, {int(row['shared_bytes']) / 1024:.1f}"
            for row in map(by_capability.__getitem__, ("80", "90", "120"))
        ]
        lines.append(f"| {kernel} | {numbers} | {found[0]['warps']} | {' | '.join(taken)} |")
    return [*lines, ""]


def replaced(text: str, name: str, lines: Sequence[str]) -> str:
    """The text with other lines between the markers of that name."""
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    inside = "\n".join([begin, "", *(lines or [NOT_MEASURED, ""]), end])
    found, count = re.subn(f"{begin}.*?{end}", lambda _: inside, text, flags=re.DOTALL)
    assert count == 1, f"{name}: {count} places"
    return found


def drawn(
    name: str,
    draw: Callable[[Sequence[Row]], list[Chart]],
    rows: Sequence[Row],
    docs: Path,
    alt: str,
) -> list[str]:
    """The lines that show a picture, which is drawn, if there is anything to show."""
    path = docs / "images" / f"{name}.svg"
    if not rows:
        path.unlink(missing_ok=True)
        return []
    path.write_text(page(draw(rows)))
    return [f"![{alt}](images/{name}.svg)", ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=ROOT / "benchmarks" / "results")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    step, sweep, train, stylize = (
        read(options.results / f"{name}.csv") for name in ("step", "occupancy", "train", "stylize")
    )
    roofs = drawn("roofline", roofline, step, options.docs, "Rooflines with the backends in them")
    cost = drawn("occupancy", occupancy, sweep, options.docs, "Time against active cells")
    spread = ("seconds_min", "seconds", "seconds_max", "peak_mb")
    kernels = read(options.results / "gpu_kernels.csv")
    blocks = {
        "roofline": roofs,
        "step": step_table(step),
        "occupancy": cost + occupancy_table(sweep) if sweep else [],
        "train": seconds_table(
            train,
            ("device", "threads", "preset", "grid", "cells", "hidden", "rollout", "view"),
            ("backend", *spread),
        ),
        "stylize": seconds_table(
            stylize,
            ("device", "threads", "grid", "frames", "cells", "steps", "hidden"),
            ("backend", "dtype", "files", "frames_per_second", *spread),
        ),
    }
    blocks["gpu_kernels"] = kernels_table(kernels)
    blocks["paint"] = seconds_table(
        read(options.results / "paint.csv"),
        ("device", "threads", "grid", "occupancy", "cells", "steps", "hidden"),
        ("dtype", *spread[:3], "processor_seconds", "peak_mb", "paper_seconds"),
    )
    path = options.docs / "kernels.md"
    text = path.read_text()
    for name, lines in blocks.items():
        text = replaced(text, name, lines)
    path.write_text(text)


if __name__ == "__main__":
    main()
