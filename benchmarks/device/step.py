"""One step on a GPU, in all that `vnca bench step` can measure there.

Run `python benchmarks/device/step.py PART --csv FILE`; PART is bench (64³ and 128³ cells, and how
cost follows the active cells) or large (200×300×200 cells).
"""

import argparse
import json
from pathlib import Path

from vnca.bench import append_csv
from vnca.bench.step import StepConfig, measure_steps, prepare
from vnca.core import Index

SMALL, LARGE = (64, 64, 64), (200, 300, 200)
OCCUPANCIES = (0.01, 0.05, 0.15, 0.5)


def asked(
    grid: Index, backends: str, dtypes: str, occupancy: float = 1.0, passes: str = "forward,both"
) -> StepConfig:
    return StepConfig(
        grid=grid,
        occupancy=occupancy,
        backends=tuple(backends.split(",")),
        passes=tuple(passes.split(",")),
        dtypes=tuple(dtypes.split(",")),
        device="cuda",
    )


PARTS = {
    "bench": [
        asked(SMALL, "plain,compile,reference,triton", "float32,tf32,float16,bfloat16"),
        asked((128, 128, 128), "plain,compile,triton", "float32,tf32,float16"),
        *(asked((128, 128, 128), "triton", "tf32,float16", share) for share in OCCUPANCIES),
    ],
    "large": [
        asked(LARGE, "plain,triton", "tf32,float16", 0.15, "forward"),
        asked(LARGE, "plain,compile,triton", "tf32,float16", 1.0, "forward"),
    ],
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--csv", type=Path, metavar="FILE", required=True)
    options = parser.parse_args()
    for config in PARTS[options.part]:
        facts = prepare(config)
        for run in measure_steps(config):
            append_csv(options.csv, facts, run.rows)
            for row in run.rows:
                print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
