"""Which tile, warps and programs suit a GPU: the constants of `vnca/engine/triton/step.py`.

Run `python benchmarks/device/sweep.py --csv FILE`. Each is varied alone, from what is there now.
"""

import argparse
import csv
from functools import partial
from pathlib import Path
from typing import Any

import torch
from triton.runtime.errors import OutOfResources

from vnca.bench import Begin, seconds
from vnca.bench.contenders import DTYPES, Case, Place, contender
from vnca.engine.triton import step as triton

CHOICES: dict[str, tuple[Any, ...]] = {
    "TILES": ((64, 32), (32, 32), (128, 32), (64, 64)),
    "PROGRAMS": (2, 3, 4, 6, 8, 16),
    "WARPS": ((4, 8, 4), (8, 8, 4), (4, 4, 4), (4, 8, 8), (4, 8, 2)),
    "UNITS": tuple(
        {4: (forward, backward), 2: (2 * forward, backward)}
        for forward in (16, 32, 64)
        for backward in (16, 32, 64)
    ),
}


def milliseconds(begin: Begin) -> float | None:
    """The best of several times; nothing if it does not fit into a multiprocessor."""
    try:
        begin()()
    except OutOfResources:
        return None
    return round(min(seconds(begin, "cuda") for _ in range(3)) * 1e3, 4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--csv", type=Path, metavar="FILE", required=True)
    options = parser.parse_args()
    case = Case.draw((128, 128, 128), 128, 1.0)
    usual = {name: getattr(triton, name) for name in CHOICES}
    rows = []
    for dtype in ("float16", "tf32", "float32"):
        torch.set_float32_matmul_precision("high" if dtype == "tf32" else "highest")
        backend = contender(case, "triton", Place("cuda", DTYPES[dtype]), threads=1)
        for name, values in CHOICES.items():
            for value in (usual[name], *(value for value in values if value != usual[name])):
                setattr(triton, name, value)
                row: dict[str, Any] = {"dtype": dtype, "constant": name, "value": value}
                row |= {
                    part: milliseconds(partial(backend.begin, part)) for part in ("forward", "both")
                }
                print(row, flush=True)
                rows.append(row)
            setattr(triton, name, usual[name])
    options.csv.parent.mkdir(parents=True, exist_ok=True)
    with options.csv.open("w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
