"""Memory that does not grow with the length of a sequence."""

import sys
from pathlib import Path
from typing import Any

import pytest

from vnca.io import write_smoke
from vnca.simulation import simulate

pytestmark = [
    pytest.mark.faults,
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the peak as Linux counts it"),
]
FRAMES, FEW = 200, 20


@pytest.mark.parametrize("on_error", ["stop", "hold"])
def test_two_hundred_frames_need_no_more_memory_than_twenty(
    program: Any, stylizing: list[object], tmp_path: Path, on_error: str
) -> None:
    smoke = tmp_path / "smoke"
    for volume in simulate("plume", resolution=20, frames=FRAMES, seed=0):
        write_smoke(smoke / f"plume_{volume.frame:04d}.vdb", volume)
    command, rule, _, *quick = stylizing
    arguments = [command, rule, smoke, *quick, "--on-error", on_error]
    # The last frames, when there is as much smoke as there ever is.
    last = ("--frames", f"{FRAMES - FEW + 1}-{FRAMES}")
    few = program.finish([*arguments, *last, "--out", tmp_path / "few"])["peak_kib"]
    many = program.finish([*arguments, "--out", tmp_path / "many"])["peak_kib"]
    assert len(list((tmp_path / "few").iterdir())) == FEW
    assert len(list((tmp_path / "many").iterdir())) == FRAMES
    print(f"peak of {FEW} frames {few} KiB, of {FRAMES} {many} KiB: {many / few - 1:+.1%}")
    assert many <= 1.05 * few
