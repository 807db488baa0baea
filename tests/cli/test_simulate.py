from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from vnca.io import SmokeFormat, read_smoke
from vnca.simulation import simulate

Vnca = Callable[..., Any]


def test_files_hold_what_was_simulated(vnca: Vnca, tmp_path: Path) -> None:
    options = ("--resolution", 16, "--frames", 4, "--seed", 3)
    outcome = vnca("simulate", "plume", "--out", tmp_path / "smoke", *options)
    assert outcome.code == 0, outcome.err
    names = sorted(path.name for path in (tmp_path / "smoke").iterdir())
    assert names == [f"plume_{number:04d}.vdb" for number in (1, 2, 3, 4)]
    made = list(simulate("plume", resolution=16, frames=4, seed=3))[-1]
    read = read_smoke(tmp_path / "smoke" / names[-1], SmokeFormat())
    there = read.box.slices(made.box)
    np.testing.assert_array_equal(read.density, made.density[there])
    assert np.count_nonzero(read.density) == np.count_nonzero(made.density)
    np.testing.assert_allclose(read.index_to_world, made.index_to_world)
    assert read.velocity is not None
    assert made.velocity is not None
    smoky = read.density > 0
    np.testing.assert_array_equal(read.velocity[smoky], made.velocity[there][smoky])


def test_same_seed_same_files(vnca: Vnca, tmp_path: Path) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        options = ("--resolution", 12, "--frames", 2, "--seed", seed)
        assert vnca("simulate", "jets", "--out", tmp_path / name, *options).code == 0
    a, b, c = ((tmp_path / n / "jets_0002.vdb").read_bytes() for n in "abc")
    assert a == b
    assert a != c
