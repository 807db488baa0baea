from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.bench import stylize
from vnca.bench.stylize import PaintedSequence, available, measure_stylizing, random_rule
from vnca.core import FloatArray
from vnca.core.errors import DisagreementError
from vnca.core.volume import Volume
from vnca.engine import native
from vnca.engine.native.bricks import BrickSession
from vnca.io import SmokeFormat, write_smoke
from vnca.io.sequence import find_frames


@pytest.fixture
def painted(tiny_smoke: Volume, tmp_path: Path) -> PaintedSequence:
    """A ball that rises for two frames."""
    x, y, z = tiny_smoke.origin
    for number in (1, 2):
        moved = replace(tiny_smoke, origin=(x, y, z + number), frame=number)
        write_smoke(tmp_path / f"ball_{number}.vdb", moved)
    sequence = find_frames(tmp_path)
    return PaintedSequence.read(random_rule(8), sequence, SmokeFormat(), steps=3, tell=pytest.fail)


def test_computing_and_files_are_timed_in_every_backend(
    painted: PaintedSequence, tmp_path: Path
) -> None:
    before = sorted(tmp_path.iterdir())
    rows = measure_stylizing(painted, available(), threads=1, repeats=2)
    assert [(r["backend"], r["files"]) for r in rows] == [
        (name, files) for name in available() for files in (False, True)
    ]
    for row in rows:
        assert (row["frames"], row["steps"], row["hidden"]) == (2, 3, 8)
        assert 500 < row["cells"] < 12**3 + 1  # a ball of radius 5.5 and what is around it
        assert 0 < row["seconds_min"] <= row["seconds"] <= row["seconds_max"]
        assert row["frames_per_second"] == pytest.approx(1 / row["seconds"], rel=0.05)
        per_cell = row["seconds"] * 1e9 / (row["cells"] * row["steps"])
        assert row["ns_per_cell"] == pytest.approx(per_cell, rel=0.05)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(native.unavailable("bfloat16") is not None, reason="no bfloat16")
def test_the_native_kernel_paints_in_bfloat16_and_the_reference_does_not(
    painted: PaintedSequence,
) -> None:
    rows = measure_stylizing(
        painted, ("native", "numpy"), threads=1, repeats=1, precision="bfloat16"
    )
    assert {row["backend"]: row["dtype"] for row in rows} == {
        "native": "bfloat16",
        "numpy": "float32",
    }


def test_nothing_is_timed_when_a_backend_paints_something_else(
    painted: PaintedSequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = BrickSession.read

    def careless(self: BrickSession, state: Any) -> FloatArray:
        return 1.1 * ours(self, state)

    def never(*arguments: Any) -> None:
        pytest.fail("timed")

    monkeypatch.setattr(BrickSession, "read", careless)
    monkeypatch.setattr(stylize, "in_turns", never)
    with pytest.raises(DisagreementError, match="native: state after a frame"):
        measure_stylizing(painted, ("numpy", "native"), threads=1, repeats=1)


def test_a_random_rule_changes_what_it_sees(painted: PaintedSequence) -> None:
    roll = painted.roll("numpy", 1, "float32")
    values = roll.paint(painted.volumes[0], roll.start()).state.values
    assert np.isfinite(values).all()
    assert np.abs(values[:-1]).max() > 1e-3
