import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from vnca.rule.model import Model
from vnca.training.checkpoint import CHECKPOINT_NAME

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
        *("ablate", frame, style, "--out", tmp_path / "runs"),
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
        *("ablate", frame, style, "--out", tmp_path, *tiny),
        *("--motion.weight", "0"),
    )
    assert "--motion.weight" in outcome.complaint
    assert not list(tmp_path.glob("*/model.safetensors"))


@pytest.fixture
def ablation(vnca: Vnca, style: Path, tiny: list[str], tmp_path: Path) -> Callable[..., Any]:
    """An ablation with one seed in a folder: `ablation(frame, more options)`."""

    def run(frame: Path, *options: object, picture: Path = style) -> Any:
        command = ("ablate", frame, picture, "--seeds", "0")
        return vnca(*command, "--out", tmp_path / "runs", *SMALL, *tiny, *options)

    return run


def stamps(folder: Path) -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in sorted(folder.rglob("*.*"))}


def test_runs_of_something_else_are_refused_and_kept(
    ablation: Callable[..., Any], frame: Path, style: Path, tmp_path: Path
) -> None:
    weight = ("--motion.weight", "0.5")
    assert ablation(frame, *weight).code == 0
    before = stamps(tmp_path / "runs")
    other_picture = tmp_path / "other.png"
    with Image.open(style) as image:
        image.transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(other_picture)
    for words, outcome in {
        "differs in its frame;": ablation(frame.with_name("ball_0003.vdb"), *weight),
        "differs in its style picture;": ablation(frame, *weight, picture=other_picture),
        "no_motion_loss-0: holds a run that differs in its options;": ablation(
            frame, *weight, "--learning-rate", "2e-3"
        ),
        "encoding-0: holds a run that differs in its options;": ablation(
            frame, "--motion.weight", "0.6"
        ),
    }.items():
        assert words in outcome.complaint
        assert "choose another --out" in outcome.complaint
    assert stamps(tmp_path / "runs") == before


def test_a_run_that_was_interrupted_is_trained_again_and_one_that_tells_nothing_is_kept(
    ablation: Callable[..., Any], frame: Path, tmp_path: Path
) -> None:
    weight = ("--motion.weight", "0.5")
    assert ablation(frame, *weight).code == 0
    both = tmp_path / "runs" / "both-0"
    before = stamps(tmp_path / "runs")
    (both / CHECKPOINT_NAME).write_bytes(b"")  # There while it is under way.
    again = ablation(frame, *weight)
    assert again.code == 0, again.err
    assert "both, seed 0" in again.err
    assert "no motion loss, seed 0" not in again.err
    after = stamps(tmp_path / "runs")
    changed = {path for path in after if before.get(path) != after[path]}
    assert {Path(path).parent.name for path in changed} == {"both-0"}
    (both / "config.json").unlink()
    assert "both-0: holds a run that does not tell" in ablation(frame, *weight).complaint
