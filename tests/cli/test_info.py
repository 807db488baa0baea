from collections.abc import Callable
from pathlib import Path
from typing import Any

from vnca.io.vdb import write_vdb
from vnca.rule.model import MODEL_NAME

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


def test_grids_that_cannot_be_read_are_listed_beside_the_others(vnca: Vnca, tmp_path: Path) -> None:
    original = Path(__file__).parents[1] / "data" / "with_frustum.vdb"
    outcome = vnca("info", original)
    assert outcome.code == 0
    assert outcome.out.splitlines() == [
        "OpenVDB file, 3 grids",
        "  density: float, fog volume, (2, 2, 2) to (12, 12, 12), voxel 1, 1, 1",
        "  clouds: float, fog volume, (2, 2, 2) to (12, 12, 12), NonlinearFrustumMap; "
        "cannot be read, only copied",
        "  vel: vec3s, unknown, (0, 0, 0) to (14, 14, 14), voxel 1, 1, 1",
    ]
    odd, data = tmp_path / "odd.vdb", bytearray(original.read_bytes())
    at = data.index(b"Tree_vec3s_5_4_3")
    data[at : at + 16] = b"Tree_quats_5_4_3"
    odd.write_bytes(data)
    lines = vnca("info", odd).out.splitlines()
    assert lines[-1].startswith("  vel: quats, unknown, ")
    assert lines[-1].endswith("voxel 1, 1, 1; cannot be read, only copied")
    data[20] = 0  # a stream: nothing tells where the grid of unknown kind would end
    at = data.index(b"Tree_float_5_4_3", data.index(b"clouds"))
    data[at : at + 16] = b"Tree_quats_5_4_3"
    odd.write_bytes(data)
    outcome = vnca("info", odd)
    assert outcome.code == 0
    assert outcome.out.splitlines()[0] == "OpenVDB file, 3 grids"
    assert "NonlinearFrustumMap; cannot be read or copied" in outcome.out
    assert "1 more cannot be found: the file has no offsets" in outcome.out


def test_a_file_without_grids_is_described(vnca: Vnca, tmp_path: Path) -> None:
    write_vdb(tmp_path / "a.vdb", [], {"shot": "7b"})
    assert vnca("info", tmp_path / "a.vdb").out.splitlines() == [
        "OpenVDB file, 0 grids", "  shot = 7b",
    ]  # fmt: skip


def test_a_model_and_its_run_are_described_alike(vnca: Vnca, model: Path) -> None:
    run, file = vnca("info", model), vnca("info", model / MODEL_NAME)
    assert (run.code, file.code) == (0, 0)
    assert run.out == file.out
    assert "352 weights" in run.out
    assert "6 channels, 8 hidden" in run.out
    assert "priors off  position" in run.out
    assert "gamma 0.7" in run.out
    assert '"night.png"' in run.out
