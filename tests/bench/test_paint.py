"""Painting frames of a size, from file to file."""

from pathlib import Path

import pytest

from vnca.bench.paint import PAPER_SECONDS, PaintCase, measure_painting
from vnca.core.errors import OptionError
from vnca.io import read_smoke

CASE = PaintCase(grid=(12, 20, 10), occupancy=0.3, frames=3, steps=2, hidden=16)


def test_smoke_moves_by_a_cell_a_frame(tmp_path: Path) -> None:
    first, second, _ = (read_smoke(frame.path) for frame in CASE.write(tmp_path))
    assert second.box == first.box.moved((0, 1, 0))
    assert (second.density == first.density).all()
    assert first.velocity is not None
    assert set(first.velocity[first.density > 0][:, 1].tolist()) == {1.0}


def test_each_precision_has_a_row_of_what_was_painted() -> None:
    (row,) = measure_painting(CASE, ["float32"], threads=1)
    smoke = 0.3 * 12 * 20 * 10
    assert smoke < row["cells"] < 12 * 22 * 12
    assert 0 < row["seconds_min"] <= row["seconds"] <= row["seconds_max"]
    assert row["processor_seconds"] > 0
    assert row["paper_seconds"] == PAPER_SECONDS
    assert (row["grid"], row["steps"], row["hidden"]) == ("12x20x10", 2, 16)


def test_it_takes_two_frames() -> None:
    from vnca.cli.bench import BenchPaint

    with pytest.raises(OptionError, match="at least 2"):
        BenchPaint(frames=1)
