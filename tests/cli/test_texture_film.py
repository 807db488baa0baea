from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.io.film_frames import brightness_of_film
from vnca.rule.model import Model

Vnca = Callable[..., Any]

TINY = (
    *("--dimensions", 2, "--block", 16, "--slice.size", 32, "--hidden", 8, "--channels", 6),
    *("--iterations", 3, "--shortest-rollout", 2, "--longest-rollout", 3, "--device", "cpu"),
    *("--appearance.samples", 64, "--appearance.layers", "stem", "block1", "--pool.size", 1),
)
SMALL = ("--size", 16, 12, "--steps", 4, "--steps-per-frame", 2)


@pytest.fixture
def moving(vnca: Vnca, style: Path, tmp_path: Path) -> Path:
    run = tmp_path / "moving"
    outcome = vnca("texture", "train", style, "--out", run, "--motion-field", "circular", *TINY)
    assert outcome.code == 0, outcome.err
    return run


def test_a_flat_texture_is_trained_and_filmed(vnca: Vnca, moving: Path, tmp_path: Path) -> None:
    model = Model.load(moving)
    assert model.training["dimensions"] == 2
    assert model.training["motion_field"] == "circular"
    assert model.rule.config.velocity_prior
    folder, film = tmp_path / "pictures", tmp_path / "a.mp4"
    for out in (folder, film):
        outcome = vnca("texture", "film", moving, "--out", out, "--frames", 3, *SMALL)
        assert outcome.code == 0, outcome.err
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["0001.png", "0002.png", "0003.png"]
    first, last = (np.asarray(Image.open(folder / name)) for name in (names[0], names[-1]))
    assert first.shape == (48, 64, 3)
    assert (first != last).any()
    assert len([*brightness_of_film(film, shorter=48, most=10)]) == 3
    picture = tmp_path / "a.png"
    assert vnca("texture", "film", moving, "--out", picture, *SMALL).code == 0
    np.testing.assert_array_equal(np.asarray(Image.open(picture)), first)
    other = tmp_path / "b.png"
    outcome = vnca("texture", "film", moving, "--out", other, "--motion-field", "up", *SMALL)
    assert outcome.code == 0, outcome.err
    assert (np.asarray(Image.open(other)) != first).any()


def test_an_interrupted_training_is_the_same_training(
    vnca: Vnca, style: Path, moving: Path, tmp_path: Path
) -> None:
    again = tmp_path / "again"
    outcome = vnca("texture", "train", style, "--out", again, "--motion-field", "circular", *TINY)
    assert outcome.code == 0, outcome.err
    assert (again / "model.safetensors").read_bytes() == (moving / "model.safetensors").read_bytes()


def test_what_does_not_go_together_is_refused(
    vnca: Vnca, style: Path, moving: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    train = ("texture", "train", style, "--out", out)
    complaint = vnca(*train, "--motion-field", "circular").complaint
    assert "--motion-field circular: a solid texture has none; add --dimensions 2" in complaint
    complaint = vnca(*train, "--motion-field", "nowhere.flo", *TINY).complaint
    assert "nowhere.flo: no such file" in complaint
    assert "expected one of still" in vnca(*train, "--motion-field", "aside", *TINY).complaint
    block = ("texture", "volume", moving, "--out", tmp_path / "a.vdb")
    assert "is a flat texture" in vnca(*block).complaint
    film = ("texture", "film", moving, "--out")
    assert "a picture has none" in vnca(*film, tmp_path / "a.png", "--frames", 3).complaint
    assert "expected a film" in vnca(*film, tmp_path / "a.txt").complaint
    assert "layer of 2" in vnca(*film, tmp_path / "a.png", "--size", 2, 64).complaint
    assert not out.exists()


def test_a_texture_that_was_not_trained_to_move_is_not_moved(
    vnca: Vnca, style: Path, tmp_path: Path
) -> None:
    run = tmp_path / "still"
    assert vnca("texture", "train", style, "--out", run, *TINY).code == 0
    assert not Model.load(run).rule.config.velocity_prior
    film = ("texture", "film", run, "--out", tmp_path / "a.png", *SMALL)
    assert vnca(*film).code == 0
    assert "was not trained to move" in vnca(*film, "--motion-field", "up").complaint
