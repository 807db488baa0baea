# SPDX-License-Identifier: GPL-3.0-or-later
"""Training from the panel: a picture becomes a style, in the Python of VNCA_PROGRAM.

In tiny numbers: nothing is learned that would be worth looking at.
"""

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from test_trouble import ends_within_a_second, said, until

from conftest import NAME, add_domain

PROGRAM = os.environ.get("VNCA_PROGRAM", "")
pytestmark = pytest.mark.skipif(not PROGRAM, reason="VNCA_PROGRAM names no vnca with torch")
PRESET = """
base = "draft"
iterations = {iterations}
texture = {texture}
shortest_rollout = 2
longest_rollout = 3
[rule]
channels = 6
hidden = 8
[view]
size = 32
[motion]
size = 32
[appearance]
layers = ["stem", "block1"]
samples = 64
"""


@pytest.fixture
def learning(scene: bpy.types.Scene, folder: Path) -> Iterator[bpy.types.Scene]:
    """A scene whose domain moves in its cache, and a picture to learn from."""
    add_domain(scene, "adaptive", folder / "cache")
    scene.vnca.folder = str(folder / "out")
    scene.frame_set(4)
    image = bpy.data.images.new("picture", 48, 48)
    pixels = np.random.default_rng(0).random((48, 48, 4), np.float32)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(folder / "Öl 油.png"), "PNG"
    image.save()
    scene.vnca.way, scene.vnca.picture = "PICTURE", str(folder / "Öl 油.png")
    scene.vnca.preset, scene.vnca.preset_file = "OWN", str(folder / "tiny.toml")
    preferences = bpy.context.preferences.addons[NAME].preferences
    preferences.python = str(Path(PROGRAM).parent.parent)
    yield scene
    preferences.python = ""


def write_preset(folder: Path, iterations: int, texture: int = 0) -> None:
    (folder / "tiny.toml").write_text(PRESET.format(iterations=iterations, texture=texture))


def begin(scene: bpy.types.Scene) -> Any:
    """Training at work, as the button begins it."""
    training, work = (import_module(f"{NAME}.{part}") for part in ("training", "work"))
    work.current = work.begin_training(bpy.context, training.train_job(scene))
    return work.current


def test_a_picture_becomes_a_style_that_paints(learning: bpy.types.Scene, folder: Path) -> None:
    write_preset(folder, iterations=2, texture=1)
    settings, work = learning.vnca, import_module(f"{NAME}.work")
    assert bpy.ops.vnca.train() == {"FINISHED"}
    version = folder / "out" / "style Öl 油" / "v001"
    assert (settings.way, Path(settings.model)) == ("MODEL", version)
    assert (version / "model.safetensors").is_file()
    assert not (version / "staged").exists()
    # Told while it was at work, and what it looks like in the end.
    assert (work.current.what, work.current.done) == ("training", 2)
    shown = bpy.data.images.load(work.current.picture)
    assert shown.size[0] == pytest.approx(shown.size[1], rel=0.05)
    assert np.array(shown.pixels[:]).std() > 0.01
    assert any("first, a solid texture" in note for note in work.current.notes)

    assert bpy.ops.vnca.paint() == {"FINISHED"}
    painted = learning.vnca.result
    assert "Domain Öl 油" in painted.data.filepath
    painted.data.grids.load()
    assert {"density", "Cd", "velocity"} <= {grid.name for grid in painted.data.grids}

    # Another one has a place of its own: what was painted with stays as it is.
    before = (version / "model.safetensors").read_bytes()
    settings.way = "PICTURE"
    assert bpy.ops.vnca.train() == {"FINISHED"}
    assert Path(settings.model) == version.with_name("v002")
    assert (version / "model.safetensors").read_bytes() == before


def test_a_cancelled_training_is_gone_on_with(learning: bpy.types.Scene, folder: Path) -> None:
    versions = import_module(f"{NAME}.versions")
    write_preset(folder, iterations=40)
    job = begin(learning)
    until(job, "training", seconds=300, least=2)
    ends_within_a_second(job)
    assert versions.can_go_on_training(learning)
    # With what it began with, whatever is chosen now.
    learning.frame_set(3)
    assert bpy.ops.vnca.train(goes_on=True) == {"FINISHED"}
    version = folder / "out" / "style Öl 油" / "v001"
    assert Path(learning.vnca.model) == version
    assert not (version / "staged").exists()
    learning.vnca.way = "PICTURE"
    assert not versions.can_go_on_training(learning)
    assert "there is no training to go on with" in said(bpy.ops.vnca.train, goes_on=True)


def test_what_training_refuses_is_its_message(learning: bpy.types.Scene, folder: Path) -> None:
    assert "there is no such preset" in said(bpy.ops.vnca.train)
    (folder / "tiny.toml").write_text("iterations = 'many'")
    assert "tiny.toml" in said(bpy.ops.vnca.train)
    write_preset(folder, iterations=2)
    Path(learning.vnca.picture).write_bytes(b"no picture")
    assert "Öl 油.png" in said(bpy.ops.vnca.train)
    assert not (folder / "out" / "style Öl 油" / "v001" / "staged").exists()
    assert learning.vnca.way == "PICTURE"


def test_the_environment_is_checked(learning: bpy.types.Scene) -> None:
    assert bpy.ops.vnca.check_training() == {"FINISHED"}
