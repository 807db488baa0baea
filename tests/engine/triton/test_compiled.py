"""The kernels compile for every generation of GPUs, into what fits there; no GPU is needed.

Triton is imported anew, since here it interprets. What was compiled before comes from its cache.
"""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("triton")
ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "benchmarks" / "device" / "compile.py"
TABLE = ROOT / "benchmarks" / "results" / "gpu_kernels.csv"
KEY = ("kernel", "numbers", "capability")


def rows(path: Path) -> dict[tuple[str, ...], dict[str, str]]:
    with path.open() as file:
        return {tuple(row[name] for name in KEY): row for row in csv.DictReader(file)}


@pytest.mark.skipif(sys.platform != "linux", reason="Triton's compiler comes for Linux")
@pytest.mark.parametrize("numbers", ["tf32x3", "float16"])
def test_kernels_fit_every_generation_and_spill_nothing(numbers: str, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    environment = {key: value for key, value in os.environ.items() if key != "TRITON_INTERPRET"}
    command = [sys.executable, SCRIPT, "--numbers", numbers, "--csv", table]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    found, kept = rows(table), {key: row for key, row in rows(TABLE).items() if key[1] == numbers}
    assert found.keys() == kept.keys(), f"write {TABLE} anew with {SCRIPT}"
    # Another compiler may choose otherwise; the same one may not, unless the table is made anew.
    for key, row in found.items():
        if row["triton"] == kept[key]["triton"]:
            assert row == kept[key], f"write {TABLE} anew with {SCRIPT}"


def test_what_spills_or_does_not_fit_is_refused() -> None:
    environment = {key: value for key, value in os.environ.items() if key != "TRITON_INTERPRET"}
    code = f"""
import runpy, dataclasses
script = runpy.run_path({str(SCRIPT)!r})
row = script["Taken"]("3", "step", "tf32x3", 120, 4, 255, 0, 0)
print(row.problem)
print(dataclasses.replace(row, stack_bytes=8).problem)
print(dataclasses.replace(row, shared_bytes=100 * 1024).problem)
print(dataclasses.replace(row, shared_bytes=100 * 1024, capability=80).problem)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == [
        "None",
        "spills 8 bytes a thread",
        "takes 102400 bytes of shared memory of 101376",
        "None",
    ]
