import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.errors import ModelError
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.io.vdb import write_vdb
from vnca.rule import Rule
from vnca.rule import conditioning as inputs
from vnca.rule.conditioning import Conditioning, register_conditioning
from vnca.rule.model import MODEL_NAME, Model

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
    assert "conditioned" not in run.out


def test_what_a_model_is_conditioned_on_is_told_also_where_it_is_not_known(
    vnca: Vnca, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(inputs, "_KNOWN", dict(inputs._KNOWN))
        register_conditioning(Conditioning.of_field("temperature", scale=1500))
        register_conditioning(Conditioning("slope", 3, lambda *_: np.zeros((0, 3), np.float32)))
        rule = Model.load(model).rule
        names = ("density", "temperature", "slope")
        config = replace(rule.config, conditioning=names)
        own = tmp_path / "own.safetensors"
        Model(Rule.initial(config, rule.scales, seed=1)).save(own)
    monkeypatch.setattr(inputs, "_KNOWN", dict(inputs._KNOWN))
    lines = vnca("info", own).out.splitlines()
    assert (
        "  conditioned on temperature: 1 number a cell, the grid of that name, of which 1500 "
        "counts as 1"
    ) in lines
    assert "  conditioned on slope: 3 numbers a cell, computed" in lines
    told = json.loads(vnca("info", own, "--json").out)
    assert told["conditioning"] == [["density", 1], ["temperature", 1, 1500.0], ["slope", 3]]
    seen = Model.load(own).rule  # known now, as what cannot be computed
    domain = Domain(np.zeros((1, 3), np.int32), smoke_of_a_cell().box)
    with pytest.raises(ModelError, match=r"conditioned on slope, .* `vnca.register_conditioning`"):
        inputs.priors(domain, smoke_of_a_cell(), seen)


def smoke_of_a_cell() -> Volume:
    one = np.ones((1, 1, 1), np.float32)
    return Volume(one, None, (0, 0, 0), np.eye(4), 1, {"temperature": one})
