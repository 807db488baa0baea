import csv
import subprocess
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[3] / "benchmarks" / "paper"
SCRIPTS = (
    "density",
    "velocity",
    "views",
    "motion_weight",
    "generalisation",
    "brightness",
    "cost",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_one_command_makes_a_study(name: str, tmp_path: Path) -> None:
    table = tmp_path / "paper.csv"
    call = [STUDIES / f"{name}.py", "--out", tmp_path, "--csv", table]
    small = ["--iterations", "2", "--size", "32", "--seeds", "0"]
    subprocess.run([sys.executable, *call, *small], check=True)
    with table.open() as file:
        assert {row["study"] for row in csv.DictReader(file)} == {name}
    assert len([*tmp_path.glob(f"{name}*.png")]) == (name != "cost")


def test_what_a_user_can_mend_is_told_in_a_line() -> None:
    call = [sys.executable, STUDIES / "density.py", "--frame", "nowhere.vdb"]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["nowhere.vdb: no such file"]
