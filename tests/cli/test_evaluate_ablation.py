import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.automaton.model import Model

Vnca = Callable[..., Any]
SMALL = ("--size", "32")


@pytest.fixture
def tiny(tiny: list[str]) -> list[str]:
    """Without a texture to begin with, of which an ablation knows nothing."""
    at = tiny.index("--texture")
    return tiny[:at] + tiny[at + 2 :]


def test_the_velocity_ablation_trains_and_compares_three_kinds(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    arguments = (
        *("evaluate", frame, style, "--ablation", "velocity", "--out", tmp_path / "runs"),
        *("--seeds", "0", "1", "--json", tmp_path / "ablation.json", *SMALL, *tiny),
        *("--motion.weight", "0.5"),
    )
    outcome = vnca(*arguments)
    assert outcome.code == 0, outcome.err
    measures = json.loads((tmp_path / "ablation.json").read_text())
    assert list(measures) == ["no motion loss", "no velocity encoding", "both"]
    assert all(len(runs) == 2 for runs in measures.values())
    for name in measures:
        assert name in outcome.out
    trained = {path.name: Model.load(path) for path in (tmp_path / "runs").iterdir()}
    assert len(trained) == 6
    assert not trained["no_velocity_encoding-1"].rule.config.velocity_prior
    assert trained["both-1"].rule.config.velocity_prior

    before = (tmp_path / "runs" / "both-0" / "model.safetensors").stat().st_mtime_ns
    again = vnca(*arguments)
    assert again.out == outcome.out
    assert (tmp_path / "runs" / "both-0" / "model.safetensors").stat().st_mtime_ns == before


def test_an_ablation_of_motion_needs_a_motion_loss(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    outcome = vnca(
        *("evaluate", frame, style, "--ablation", "velocity", "--out", tmp_path, *tiny),
        *("--motion.weight", "0"),
    )
    assert "--motion.weight" in outcome.complaint
    assert not list(tmp_path.glob("*/model.safetensors"))
