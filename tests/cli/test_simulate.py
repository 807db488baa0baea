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


def test_the_papers_jet_at_a_resolution_of_ones_own(vnca: Vnca, tmp_path: Path) -> None:
    call = ("simulate", "jet", "--preset", "paper", "-o", tmp_path, "--resolution", 16)
    outcome = vnca(*call, "--frames", 2)
    assert outcome.code == 0, outcome.err
    assert len(list(tmp_path.glob("jet_*.vdb"))) == 2
    assert "--preset" in vnca("simulate", "plume", "--preset", "paper", "-o", tmp_path).complaint


def test_smoke_around_a_mesh_of_the_users(vnca: Vnca, tmp_path: Path) -> None:
    mesh = tmp_path / "pyramid.obj"
    mesh.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0.5 1 0.5\n"
        "f 1 2 3\nf 1 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n"
    )
    call = ("simulate", "bunny", "-o", tmp_path / "smoke", "--resolution", 16, "--frames", 2)
    assert "--mesh" in vnca(*call).complaint
    outcome = vnca(*call, "--mesh", mesh)
    assert outcome.code == 0, outcome.err
    smoke = read_smoke(tmp_path / "smoke" / "bunny_0002.vdb", SmokeFormat())
    assert smoke.density.sum() > 0
    assert "nowhere.obj" in vnca(*call, "--mesh", tmp_path / "nowhere.obj").complaint
