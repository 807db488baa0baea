"""One rule of several pictures, as a user trains it, looks at it and paints with it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.io.vdb import open_vdb
from vnca.rule.mixing import ORIGINS, origin
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME
from vnca.training.loop import Progress, Trainer

Vnca = Callable[..., Any]

BLOCK = (
    *("--block", 16, "--slice.size", 32, "--hidden", 8, "--channels", 6, "--iterations", 4),
    *("--shortest-rollout", 2, "--longest-rollout", 3, "--appearance.samples", 64),
    *("--appearance.layers", "stem", "block1", "--device", "cpu", "--graft", "none"),
)


@pytest.fixture(autouse=True)
def small_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of the time, and nothing here is about how they look."""
    monkeypatch.setattr("vnca.training.run.PREVIEW_SIZE", 32)


@pytest.fixture
def lava(tmp_path: Path) -> Path:
    rows = np.add(*np.mgrid[:40, :50] // 5) % 2
    red = np.zeros((*rows.shape, 3), np.uint8)
    red[..., 0] = 200 * rows
    Image.fromarray(red).save(tmp_path / "lava.png")
    return tmp_path / "lava.png"


@pytest.fixture
def trained(vnca: Vnca, frame: Path, style: Path, lava: Path, tiny: list[str], tmp_path: Path):
    run = tmp_path / "both"
    outcome = vnca("train", frame, style, lava, "--out", run, *tiny)
    assert outcome.code == 0, outcome.err
    assert "2 styles: 3 iterations" in outcome.err
    return run


def test_a_model_tells_of_its_styles(vnca: Vnca, trained: Path, tmp_path: Path) -> None:
    model = Model.load(trained)
    assert model.style_names == ["style", "lava"]
    assert len(model.thumbnails) == 2
    lines = vnca("info", trained).out.splitlines()
    assert [line.split()[:3] for line in lines if line.startswith("  style ")] == [
        ["style", "1", "style:"], ["style", "2", "lava:"], ["style", '"style.png,', 'lava.png"'],
    ]  # fmt: skip
    told = json.loads(vnca("info", trained, "--json").out)["styles"]
    assert [(each["number"], each["name"]) for each in told] == [(1, "style"), (2, "lava")]
    assert all(each["picture_cells"] > 0 and each["palette"] for each in told)
    listed = vnca("styles", trained, "--sheet", tmp_path / "sheet.png").out.splitlines()
    assert [line.split()[:3] for line in listed] == [
        ["1", "style", "style.png"], ["2", "lava", "lava.png"],
    ]  # fmt: skip
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.width > 1.5 * sheet.height  # two beside each other
    assert json.loads((trained / "config.json").read_text())["inputs"]["more_styles"]


def test_each_style_is_saved_as_a_model_of_its_own(
    vnca: Vnca, trained: Path, smoke: Path, tmp_path: Path
) -> None:
    assert vnca("styles", trained, "--save", tmp_path / "apart").code == 0
    models = sorted((tmp_path / "apart").glob("*"))
    assert [path.name for path in models] == ["lava.safetensors", "style.safetensors"]
    few = ("--warmup", 3, "--steps-per-frame", 2)
    vnca("stylize", models[0], smoke, "--out", tmp_path / "one", *few)
    vnca("stylize", trained, smoke, "--out", tmp_path / "two", "--style-mix", "lava", *few)
    for path in sorted((tmp_path / "one").glob("*.vdb")):
        with open_vdb(path) as one, open_vdb(tmp_path / "two" / path.name) as two:
            grids = [file.read("Cd") for file in (one, two)]
            first, second = (grid.to_dense(grids[0].active_box())[0] for grid in grids)
            np.testing.assert_allclose(first, second, atol=2e-3)
    assert "has learnt a single style, lava.png" in vnca("styles", models[0]).complaint
    assert "the styles of which model?" in vnca("styles", "--save", tmp_path / "x").complaint


def test_painting_says_which_style_unless_one_is_asked_for(
    vnca: Vnca, trained: Path, smoke: Path, tmp_path: Path
) -> None:
    few = ("--warmup", 3, "--steps-per-frame", 2, "--frames", "1")
    said = vnca("stylize", trained, smoke, "--out", tmp_path / "a", *few).err
    assert "painting in the first of the styles 1 style, 2 lava; --style-mix asks for" in said
    said = vnca("stylize", trained, smoke, "--out", tmp_path / "b", "--style-mix", "2", *few).err
    assert "first of the styles" not in said
    wrong = vnca("stylize", trained, smoke, "--out", tmp_path / "c", "--style-mix", "sea", *few)
    assert "--style-mix sea: the model has the styles 1 style, 2 lava" in wrong.complaint
    wrong = vnca("stylize", trained, smoke, "--out", tmp_path / "c", "--style-mix", "2=@@", *few)
    assert wrong.code == 2
    assert "--style-mix" in wrong.err


def test_it_is_measured_by_the_picture_of_the_style_asked_for(vnca: Vnca, trained: Path) -> None:
    small = ("--size", "64", "--style-scale", "1", "--warmup", "3", "--steps-per-frame", "2")
    mixed = vnca("evaluate", trained, *small, "--style-mix", "lava=0.5")
    assert "--style-mix: what is measured is one style; name it alone" in mixed.complaint
    layered = vnca("evaluate", trained, *small, "--layers", "ink=0.5")
    assert "--layers: what is measured is one rule" in layered.complaint


def test_a_block_is_grown_in_the_style_asked_for(vnca: Vnca, trained: Path, tmp_path: Path) -> None:
    grown = ("--block", 16, "--steps", 3, "--out")
    said = vnca("texture", "volume", trained, *grown, tmp_path / "first.npz")
    assert "growing the first of the styles 1 style, 2 lava" in said.err
    for name in ("1", "lava"):
        out = tmp_path / f"{name}.npz"
        assert vnca("texture", "volume", trained, *grown, out, "--style", name).code == 0
    first, again, lava = (
        np.load(tmp_path / f"{name}.npz")["Cd"] for name in ("first", "1", "lava")
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, lava)
    wrong = vnca("texture", "volume", trained, *grown, out, "--style", "sea")
    assert "--style sea: the model has the styles 1 style, 2 lava" in wrong.complaint


def test_too_many_pictures_and_broken_ones_are_told(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    many = vnca("train", frame, *9 * [style], "--out", tmp_path / "many", *tiny)
    assert "9 pictures; expected 1 to 8" in many.complaint
    (tmp_path / "bad.png").write_bytes(b"no picture")
    bad = vnca("train", frame, style, tmp_path / "bad.png", "--out", tmp_path / "bad", *tiny)
    assert "bad.png" in bad.complaint


def test_interrupted_it_ends_in_the_same_model(
    vnca: Vnca, style: Path, lava: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    improve = Trainer.improve

    def interrupted(self: Trainer) -> Progress:
        if self.iteration == 3:
            raise KeyboardInterrupt
        return improve(self)

    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert vnca("texture", "train", style, lava, "--out", whole, *BLOCK).code == 0
    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "improve", interrupted)
        assert vnca("texture", "train", style, lava, "--out", parts, *BLOCK).code == 130
    assert (parts / CHECKPOINT_NAME).exists()
    moved = lava.rename(tmp_path / "elsewhere.png")
    gone = vnca("texture", "train", "--resume", parts)
    assert "lava.png" in gone.complaint
    again = vnca("texture", "train", "--resume", parts, "--more-styles", moved)
    assert again.code == 0, again.err
    one, two = (Model.load(run) for run in (whole, parts))
    np.testing.assert_array_equal(one.rule.hidden, two.rule.hidden)
    np.testing.assert_array_equal(one.rule.output, two.rule.output)


def test_smoke_begins_with_the_texture_of_the_same_pictures_and_tells_it(
    vnca: Vnca, frame: Path, style: Path, lava: Path, tiny: list[str], tmp_path: Path
) -> None:
    texture, run, other = tmp_path / "texture", tmp_path / "run", tmp_path / "other"
    assert vnca("texture", "train", style, lava, "--out", texture, *BLOCK).code == 0
    begun = tiny[: tiny.index("--texture")]
    for seed, out in enumerate((run, other)):
        options = ("--init", texture, "--seed", seed, "--sobel-divisor", 8)
        outcome = vnca("train", frame, style, lava, "--out", out, *begun, *options)
        assert outcome.code == 0, outcome.err
    root = origin(Model.load(texture).rule)
    assert [Model.load(each).training[ORIGINS] for each in (run, other)] == [[root], [root]]
    smoke, few = frame.parent, ("--warmup", 3, "--steps-per-frame", 2, "--frames", "1-2")
    blend = ("--blend", f"{other / MODEL_NAME}=1:0 2:1")
    painted = vnca("stylize", run, smoke, "--out", tmp_path / "painted", *blend, *few)
    assert painted.code == 0, painted.err
