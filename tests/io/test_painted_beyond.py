"""Smoke that was moved beyond the cells of its file."""

from pathlib import Path

import numpy as np
import pytest

from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, write_painted, write_smoke

FAR = 3


def test_smoke_moved_out_of_its_cells_is_kept_only_if_that_is_said(
    tiny_smoke: Volume, tmp_path: Path
) -> None:
    source = tmp_path / "ball.vdb"
    write_smoke(source, tiny_smoke)
    smoke = read_smoke(source, SmokeFormat())
    box = smoke.box.grown(FAR)
    moved = np.roll(smoke.density_field.dense(box), FAR, axis=2)
    colour = np.ones((*box.shape, 3), np.float32)
    masses = []
    for beyond in (0, FAR):
        path = tmp_path / f"painted_{beyond}.vdb"
        write_painted(
            path, source, SmokeFormat(), density=moved, colour=colour, box=box, beyond=beyond
        )
        painted = read_smoke(path, SmokeFormat())
        assert np.allclose(painted.index_to_world, smoke.index_to_world)
        masses.append(float(painted.density.sum()))
    whole = float(smoke.density.sum())
    assert masses[0] < 0.95 * whole
    assert masses[1] == pytest.approx(whole, rel=1e-5)
