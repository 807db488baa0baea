import csv
import json
from pathlib import Path

import pytest

from vnca.bench.records import append_csv, write_json
from vnca.core.errors import FileFormatError

FACTS = {"device": "abacus, wooden"}


def test_a_table_grows_by_the_rows_of_each_run(tmp_path: Path) -> None:
    path = tmp_path / "new" / "table.csv"
    append_csv(path, FACTS, [{"ns": 1.5}, {"ns": 2.5}])
    append_csv(path, FACTS, [{"ns": None}])
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["ns"] for row in rows] == ["1.5", "2.5", ""]
    assert {row["device"] for row in rows} == {"abacus, wooden"}


def test_a_table_of_something_else_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("date,price\n1,2\n")
    with pytest.raises(FileFormatError, match=r"table\.csv.*other columns"):
        append_csv(path, FACTS, [{"ns": 1}])
    assert path.read_text() == "date,price\n1,2\n"


def test_one_object_has_the_facts_and_the_rows(tmp_path: Path) -> None:
    write_json(tmp_path / "run.json", FACTS, [{"ns": 1}])
    assert json.loads((tmp_path / "run.json").read_text()) == {**FACTS, "rows": [{"ns": 1}]}
