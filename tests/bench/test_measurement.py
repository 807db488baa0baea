"""Times in turns, peak memory, and the tables that a run writes."""

import csv
import json
import time
from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from vnca.bench import Spread, append_csv, in_turns, peak_mb, seconds, write_json
from vnca.core.errors import FileFormatError

FACTS = {"device": "abacus, wooden"}


def test_kinds_of_work_take_turns() -> None:
    done: list[str] = []

    def begin(name: str) -> Callable[[], Callable[[], object]]:
        def work() -> None:
            done.append(name)
            time.sleep(0.02)

        return lambda: work

    times = in_turns({"a": begin("a"), "b": begin("b")}, "cpu", repeats=3)
    assert [name for name, _ in groupby(done)] == ["a", "b"] * 3
    assert [len(taken) for taken in times.values()] == [3, 3]


def test_what_comes_before_the_work_is_not_timed() -> None:
    def begin() -> Callable[[], object]:
        time.sleep(1.0)
        return lambda: time.sleep(0.1)

    assert 0.1 <= seconds(begin, "cpu") < 0.9


def test_short_work_is_repeated_so_that_waking_up_does_not_count() -> None:
    calls = []
    seconds(lambda: lambda: calls.append(time.sleep(0.01)), "cpu")
    assert len(calls) > 5


def test_a_spread_is_of_the_extremes_and_the_middle() -> None:
    assert Spread.of([5.0, 1.0, 2.0]) == (1, 2, 5)


def taking(megabytes: int, pieces: int) -> Callable[[], object]:
    """Takes memory in so many pieces, all at once, and gives it back."""
    size = megabytes * 10**6 // 8 // pieces
    return lambda: len([np.ones(size) for _ in range(pieces)])


@pytest.mark.parametrize(("megabytes", "pieces"), [(40, 1), (40, 4), (20, 400)])
def test_the_peak_is_what_was_taken_however_often(megabytes: int, pieces: int) -> None:
    work = taking(megabytes, pieces)
    found = [peak_mb(work, "cpu") for _ in range(3)]  # later ones could reuse what was freed
    if found[0] is None:
        pytest.skip("this system does not tell")
    assert found == pytest.approx([megabytes] * 3, abs=4)


def test_memory_held_before_does_not_count() -> None:
    held = np.ones(5_000_000)
    found = peak_mb(held.sum, "cpu")
    assert found is None or found < 4


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
