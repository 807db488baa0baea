from collections.abc import Callable
from pathlib import Path
from typing import Any

from vnca.automaton.model import MODEL_NAME

Vnca = Callable[..., Any]


def test_a_vdb_file_is_described_grid_by_grid(vnca: Vnca, frame: Path) -> None:
    out = vnca("info", frame).out
    assert "3 grids" in out
    assert "density: float, fog volume, (-2, 5, 10) to (8, 15, 20), voxel 0.1, 0.1, 0.1" in out
    assert "velocity: vec3s" in out
    assert "temperature: float" in out
    assert "shot = shot 2" in out


def test_a_real_file_is_described(vnca: Vnca) -> None:
    real = Path(__file__).parents[1] / "data" / "plume_sphere_0030.vdb"
    outcome = vnca("info", real)
    assert outcome.code == 0
    assert "density" in outcome.out
    assert "saved as half" in outcome.out


def test_a_model_and_its_run_are_described_alike(vnca: Vnca, model: Path) -> None:
    run, file = vnca("info", model), vnca("info", model / MODEL_NAME)
    assert (run.code, file.code) == (0, 0)
    assert run.out == file.out
    assert "352 weights" in run.out
    assert "6 channels, 8 hidden" in run.out
    assert "priors off  position" in run.out
    assert "gamma 0.7" in run.out
    assert '"night.png"' in run.out
