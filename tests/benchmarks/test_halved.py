"""Smoke on half of its cells is the same smoke."""

from pathlib import Path
from subprocess import run
from sys import executable

import numpy as np

from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import write_smoke

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "halved.py"


def test_mass_place_and_motion_stay(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    density = random.uniform(0, 1, (9, 8, 7)).astype(np.float32)
    velocity = random.normal(size=(9, 8, 7, 3)).astype(np.float32)
    smoke = Volume(density, velocity, (3, -2, 5), np.diag([0.1, 0.1, 0.1, 1.0]), 4)
    (tmp_path / "smoke").mkdir()
    write_smoke(tmp_path / "smoke" / "smoke_0004.vdb", smoke)
    run([executable, SCRIPT, tmp_path / "smoke", "--out", tmp_path / "half"], check=True)
    half = read_smoke(tmp_path / "half" / "smoke_0004.vdb", SmokeFormat())
    assert half.density.shape == (5, 4, 4)
    assert half.velocity is not None

    def told(volume: Volume) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, its middle and its mean motion in the world."""
        cells = np.moveaxis(np.indices(volume.density.shape), 0, -1)
        to_world = volume.cells_to_world
        places = cells @ to_world[:3, :3].T + to_world[:3, 3]
        weight = volume.density[..., None] / volume.density.sum()
        assert volume.velocity is not None
        motion = volume.velocity * volume.cell_length
        mass = float(volume.density.sum()) * volume.cell_length**3
        return mass, (weight * places).sum((0, 1, 2)), (weight * motion).sum((0, 1, 2))

    (mass, middle, motion), (was, before, moved) = told(half), told(smoke)
    np.testing.assert_allclose(mass, was, rtol=1e-4)
    np.testing.assert_allclose(motion, moved, rtol=1e-3, atol=1e-6)
    # At its border a cell is half of one of the coarse ones.
    np.testing.assert_allclose(middle, before, atol=0.25 * smoke.cell_length)
