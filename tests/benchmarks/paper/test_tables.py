from pathlib import Path

import pytest
from tables import BEGIN, END, MISSING, PAPER, TRAITS, measured, put_into, read, tables

from vnca.core.errors import FileFormatError


def row(**values: str) -> dict[str, str]:
    plain = {"study": "density", "variant": "with density encoding", "measure": "L_app"}
    return {**plain, "preset": "draft", "on": "cells in smoke", "seed": "0", **values}


def test_nothing_measured_is_said_to_be_so() -> None:
    text = tables([])
    assert "463 s" in text  # the paper's
    rows = [line for line in text.splitlines() if line.startswith("| L_app, density")]
    assert rows == [f"| L_app, density encoding | 7.29 | 5.42 |{f' {MISSING} |' * 4}"]
    assert all(len(signs) == len(TRAITS) for signs in PAPER.values())


def test_cells_have_mean_and_deviation_over_seeds() -> None:
    rows = [row(value="2"), row(value="4", seed="1"), row(value="5", seed="1", preset="draft!")]
    found = measured(rows, "density", "with density encoding", "L_app", preset="draft")
    assert found == "3 ± 1"
    assert measured(rows, "density", "without density encoding", "L_app") == MISSING


def test_set_ups_are_not_mixed_and_the_last_counts() -> None:
    rows = [row(value="2", iterations="9"), row(value="4", iterations="400")]
    assert measured(rows, "density", "with density encoding", "L_app") == "4"
    rows.append(row(value="6", iterations="400"))  # the same again
    assert measured(rows, "density", "with density encoding", "L_app") == "6"


def test_scalings_have_cells_of_their_own() -> None:
    rows = [row(value="3"), row(value="5", preset="draft + authors' scaling")]
    line = next(part for part in tables(rows).splitlines() if part.startswith("| L_app, density"))
    assert line.split(" | ")[3:] == [MISSING, "3", MISSING, "5 |"]


def test_measures_of_methods_stand_in_both_tables() -> None:
    plain = {"study": "methods", "variant": "lnst", "on": "48×72×48", "preset": "draft"}
    rows = [row(**plain, measure="Seconds a frame", value="12.5")]
    found = tables(rows)
    assert "+ and −" in found
    assert "12.5 s" in next(part for part in found.splitlines() if part.startswith("| LNST | −"))
    assert "| 12.5 |" in next(part for part in found.splitlines() if "| 10 s |" in part)
    assert "Ours: 48×72×48 cells" in found


def test_tables_are_put_between_their_marks(tmp_path: Path) -> None:
    path = tmp_path / "a.md"
    path.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    put_into(path, "new\n")
    assert path.read_text() == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"
    (tmp_path / "b.md").write_text("no marks")
    with pytest.raises(FileFormatError, match=r"b\.md: expected the marks"):
        put_into(tmp_path / "b.md", "new\n")


def test_what_is_no_table_of_findings_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y\n1,2\n")
    with pytest.raises(FileFormatError, match=r"a\.csv: not a table of findings"):
        read([tmp_path / "a.csv"])
