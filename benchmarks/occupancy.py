"""What a step costs when more or fewer cells of a box live: 1 % to 100 %, all in turns, in one run.

Run `python benchmarks/occupancy.py --csv benchmarks/results/occupancy.csv`; `report.py` draws it.
"""

import argparse
import os
from pathlib import Path

from vnca.bench import append_csv
from vnca.bench.contenders import Case
from vnca.bench.step import StepConfig, measure, prepare, take_part
from vnca.core import Index

SHARES = (0.01, 0.02, 0.05, 0.1, 0.15, 0.25, 0.5, 0.75, 1.0)


def grid(text: str) -> Index:
    x, y, z = map(int, text.split("x"))
    return x, y, z


def names(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", type=grid, default=(128, 128, 128), metavar="XxYxZ")
    parser.add_argument("--hidden", type=int, default=128)
    parser.add_argument("--backends", type=names, default=("native",))
    parser.add_argument("--passes", type=names, default=("forward", "both"))
    parser.add_argument("--dtype", default="float32")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--csv", type=Path, required=True, metavar="FILE", help="add the rows here")
    options = parser.parse_args()
    config = StepConfig(
        grid=options.grid,
        hidden=options.hidden,
        backends=options.backends,
        passes=options.passes,
        dtypes=(options.dtype,),
        device=options.device,
        threads=options.threads,
        repeats=options.repeats,
    )
    facts = prepare(config)
    entries = [
        entry
        for share in SHARES
        for entry in take_part(Case.draw(config.grid, config.hidden, share), config, options.dtype)
    ]
    run = measure(entries, config, options.dtype)
    append_csv(options.csv, facts, run.rows)
    for row in run.rows:
        print(
            f"{row['backend']} {row['pass']:8} {row['occupancy']:7.2%} alive: "
            f"{row['ns_per_cell']:.4g} ns an active cell"
        )


if __name__ == "__main__":
    main()
