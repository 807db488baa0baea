"""Every mistake a user can make ends in one line that names the thing, and in exit code 2."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import load_file, save_file

from vnca.core.volume import Volume
from vnca.features.efficientnet import EfficientNet
from vnca.features.vgg import VGG16
from vnca.io import write_smoke
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb
from vnca.rule.model import FORMAT_VERSION, MODEL_NAME
from vnca.training.loop import Trainer

Vnca = Callable[..., Any]
QUICK = ("--warmup", 1, "--steps-per-frame", 1)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Where output would appear; no test in this file leaves any."""
    return tmp_path / "out"


@pytest.fixture(autouse=True)
def no_output(out: Path) -> Any:
    yield
    assert not out.exists()


@pytest.fixture
def no_long_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails the test if anything begins that may take hours."""

    def begin(*_: object, **__: object) -> None:
        pytest.fail("long work began before the mistake was found")

    for network in (EfficientNet, VGG16):
        monkeypatch.setattr(network, "load", begin)
    monkeypatch.setattr(Trainer, "improve", begin)
    monkeypatch.setattr("vnca.painting.Roll.stepped", begin)
    monkeypatch.setattr("vnca.recipe.rendering.read_colour", begin)


def rewritten(path: Path, grids: Callable[[dict[str, Grid]], list[Grid]]) -> None:
    """Replace the grids of a file by those that a function makes of them."""
    with open_vdb(path) as file:
        write_vdb(path, grids({name: header.read() for name, header in file.grids.items()}))


# Files


@pytest.mark.parametrize("command", ["info", "stylize", "train"])
def test_a_missing_file(vnca: Vnca, model: Path, style: Path, out: Path, command: str) -> None:
    missing = model / "smoke_0001.vdb"
    arguments = {
        "info": [missing],
        "stylize": [model, missing, "--out", out],
        "train": [missing, style, "--out", out],
    }[command]
    complaint = vnca(command, *arguments).complaint
    assert "smoke_0001.vdb" in complaint
    assert "no such file" in complaint


def test_an_empty_file(vnca: Vnca, model: Path, style: Path, frame: Path, out: Path) -> None:
    frame.write_bytes(b"")
    for arguments in (["info", frame], ["train", frame, style, "--out", out]):
        assert f"{frame}: the file is empty" in vnca(*arguments).complaint
    assert "is empty" in vnca("stylize", model, frame.parent, "--out", out).complaint


def test_a_truncated_vdb(vnca: Vnca, model: Path, frame: Path, out: Path) -> None:
    whole = frame.read_bytes()
    for part in (0.001, 0.02, 0.1, 0.3, 0.6, 0.9, 0.99, 0.9999):
        frame.write_bytes(whole[: max(1, int(part * len(whole)))])
        assert frame.name in vnca("stylize", model, frame, "--out", out, *QUICK).complaint


def test_a_damaged_vdb_is_read_or_refused(
    vnca: Vnca, model: Path, frame: Path, tmp_path: Path
) -> None:
    whole, random = frame.read_bytes(), np.random.default_rng(5)
    refused = 0
    for trial in range(60):
        damaged = bytearray(whole)
        # Every second one in the headers, where it matters most.
        at = int(random.integers(0, 1500 if trial % 2 else len(whole)))
        damaged[at] ^= 1 << int(random.integers(8))
        frame.write_bytes(damaged)
        outcome = vnca("stylize", model, frame, "--out", tmp_path / f"{trial}", *QUICK)
        if outcome.code:
            refused += 1
            assert frame.name in outcome.complaint, at
            assert not (tmp_path / f"{trial}").exists()
    assert refused


@pytest.mark.parametrize(
    "content", [b"no picture", b"\x89PNG\r\n\x1a\n" + bytes(50)], ids=["text", "damaged"]
)
@pytest.mark.usefixtures("no_long_work")
def test_a_picture_that_is_none(
    vnca: Vnca, frame: Path, style: Path, out: Path, content: bytes
) -> None:
    style.write_bytes(content)
    assert f"{style}: " in vnca("train", frame, style, "--out", out).complaint
    assert "picture" in vnca("demo", "--style", style, "--out", out).complaint


@pytest.mark.parametrize(
    ("size", "colour", "line"),
    [
        ((64, 64), (0, 0, 0, 0), "fully transparent"),
        ((64, 64), (9, 99, 199, 255), "a single colour"),
        ((1, 1), (9, 99, 199, 255), "1×1 pixels"),
    ],
)
@pytest.mark.usefixtures("no_long_work")
def test_a_picture_from_which_nothing_can_be_learned(
    vnca: Vnca, frame: Path, style: Path, out: Path, size: Any, colour: Any, line: str
) -> None:
    Image.new("RGBA", size, colour).save(style)
    for arguments in (
        ("train", frame, style, "--out", out),
        ("texture", "train", style, "--out", out),
        ("demo", "--style", style, "--out", out),
    ):
        complaint = vnca(*arguments).complaint
        assert f"{style}: the picture " in complaint
        assert line in complaint


def test_a_file_of_smoke_of_another_kind(vnca: Vnca, model: Path, style: Path, out: Path) -> None:
    for arguments in (["info", style], ["stylize", model, style, "--out", out]):
        complaint = vnca(*arguments).complaint
        assert f"{style}: expected" in complaint
        assert ".vdb" in complaint


# Grids


def test_no_density_grid(vnca: Vnca, model: Path, style: Path, frame: Path, out: Path) -> None:
    rewritten(frame, lambda grids: [grids["velocity"], grids["temperature"]])
    for arguments in (["stylize", model, frame], ["train", frame, style]):
        complaint = vnca(*arguments, "--out", out).complaint
        assert f"{frame}: no density grid 'density'" in complaint
        assert "--density-grid" in complaint
        assert "temperature (float)" in complaint


def test_a_density_grid_of_vectors(vnca: Vnca, model: Path, frame: Path, out: Path) -> None:
    arguments = ["stylize", model, frame, "--out", out, "--density-grid", "velocity"]
    assert "holds vectors" in vnca(*arguments).complaint


def test_velocity_that_does_not_meet_the_density(
    vnca: Vnca, model: Path, frame: Path, out: Path
) -> None:
    def moved(grids: dict[str, Grid]) -> list[Grid]:
        values, active = grids["velocity"].to_dense(grids["velocity"].active_box())
        away = Grid.from_dense("velocity", values, active, (500, 0, 0), like=grids["velocity"])
        return [grids["density"], away]

    rewritten(frame, moved)
    complaint = vnca("stylize", model, frame, "--out", out).complaint
    assert "velocity grid 'velocity'" in complaint
    assert "do not meet" in complaint


def test_velocity_of_larger_cells_somewhere_else(
    vnca: Vnca, model: Path, frame: Path, out: Path
) -> None:
    def elsewhere(grids: dict[str, Grid]) -> list[Grid]:
        old = grids["velocity"]
        values, active = old.to_dense(old.active_box())
        transform = Transform.uniform(0.2, (50, 0, 0))
        origin = old.active_box().lower
        return [
            grids["density"],
            Grid.from_dense("velocity", values, active, origin, transform=transform),
        ]

    rewritten(frame, elsewhere)
    complaint = vnca("stylize", model, frame, "--out", out).complaint
    assert f"{frame}: velocity grid 'velocity' has no value near the smoke" in complaint
    assert "--velocity-grid none" in complaint


@pytest.mark.parametrize("name", ["density", "velocity"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_not_finite(
    vnca: Vnca, model: Path, style: Path, frame: Path, out: Path, name: str, value: float
) -> None:
    def poisoned(grids: dict[str, Grid]) -> list[Grid]:
        old = grids[name]
        values, active = old.to_dense(old.active_box())
        values[5, 5, 5] = value
        grids[name] = Grid.from_dense(name, values, active, old.active_box().lower, like=old)
        return list(grids.values())

    rewritten(frame, poisoned)
    for arguments in (["stylize", model, frame], ["train", frame, style]):
        complaint = vnca(*arguments, "--out", out).complaint
        assert f"{frame}: grid '{name}'" in complaint
        assert "NaN" in complaint


def test_negative_density(
    vnca: Vnca, tiny_smoke: Volume, model: Path, frame: Path, out: Path
) -> None:
    def negative(grids: dict[str, Grid]) -> list[Grid]:
        old = grids["density"]
        values, active = old.to_dense(old.active_box())
        box = old.active_box()
        return [Grid.from_dense("density", values - 0.5, active, box.lower, like=old)]

    rewritten(frame, negative)
    assert "none below zero" in vnca("stylize", model, frame, "--out", out).complaint


@pytest.mark.parametrize("cells", [0, 4])
@pytest.mark.usefixtures("no_long_work")
def test_training_on_a_frame_without_smoke(
    vnca: Vnca, frame: Path, style: Path, out: Path, cells: int
) -> None:
    def emptied(grids: dict[str, Grid]) -> list[Grid]:
        old = grids["density"]
        nothing = np.zeros((cells,) * 3, np.float32)
        return [Grid.from_dense("density", nothing, nothing == 0, (0, 0, 0), like=old)]

    rewritten(frame, emptied)
    complaint = vnca("train", frame, style, "--out", out).complaint
    assert f"{frame}: there is no smoke" in complaint
    assert "choose a later one" in complaint


@pytest.mark.parametrize("command", ["stylize", "render"])
def test_a_sequence_without_any_smoke(
    vnca: Vnca, smoke: Path, model: Path, out: Path, command: str
) -> None:
    for number, frame in enumerate(sorted(smoke.iterdir())):
        empty = Volume(np.zeros((0, 0, 0), np.float32), None, (0, 0, 0), np.eye(4), number)
        write_smoke(frame, empty)
    arguments = [model, smoke, "--out", out] if command == "stylize" else [smoke]
    if command == "render":
        arguments += ["--out", out.with_suffix(".gif")]
    complaint = vnca(command, *arguments).complaint
    assert f"{smoke}: there is no smoke in any frame" in complaint
    assert not out.with_suffix(".gif").exists()


# Places to write


@pytest.mark.usefixtures("no_long_work")
def test_a_file_where_the_folder_should_be(
    vnca: Vnca, frame: Path, smoke: Path, style: Path, model: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine"
    mine.write_text("mine")
    for arguments in (
        ["train", frame, style, "--out", mine],
        ["train", frame, style, "--out", mine / "run"],
        ["stylize", model, smoke, "--out", mine],
        ["simulate", "plume", "--out", mine],
        ["demo", "--out", mine],
        ["render", smoke, "--out", mine / "film.gif"],
        ["render", smoke, "--out", mine / "strip.png", "--strip", 2],
    ):
        complaint = vnca(*arguments).complaint
        assert f"{mine}" in complaint, arguments
        assert "cannot be written" in complaint
    assert mine.read_text() == "mine"


@pytest.mark.usefixtures("no_long_work")
def test_a_folder_that_may_not_be_written(
    vnca: Vnca,
    frame: Path,
    smoke: Path,
    style: Path,
    model: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    locked = tmp_path / "locked"
    locked.mkdir()
    # Permissions do not stop root, who may run this test.
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != locked)
    for arguments in (
        ["train", frame, style, "--out", locked / "run"],
        ["stylize", model, smoke, "--out", locked],
        ["simulate", "plume", "--out", locked],
    ):
        assert "no permission" in vnca(*arguments).complaint


@pytest.mark.usefixtures("no_long_work")
def test_a_preview_that_is_no_film_or_cannot_be_written(
    vnca: Vnca, smoke: Path, model: Path, out: Path, tmp_path: Path
) -> None:
    stylize = ["stylize", model, smoke, "--out", out, "--preview"]
    complaint = vnca(*stylize, tmp_path / "film.xyz").complaint
    assert "film.xyz" in complaint
    assert ".mp4" in complaint
    (tmp_path / "film.gif").mkdir()
    assert "it is a folder" in vnca(*stylize, tmp_path / "film.gif").complaint
    assert "not a folder" in vnca(*stylize, model / MODEL_NAME / "film.gif").complaint


@pytest.mark.usefixtures("no_long_work")
def test_a_rendering_of_unknown_kind(vnca: Vnca, smoke: Path, tmp_path: Path) -> None:
    for name in ("film.xyz", "frames", "frame_####.tga"):
        complaint = vnca("render", smoke, "--out", tmp_path / name).complaint
        assert name in complaint
        assert ".mp4" in complaint
        assert ".png" in complaint


@pytest.mark.usefixtures("no_long_work")
def test_painting_into_the_folder_of_the_input(vnca: Vnca, smoke: Path, model: Path) -> None:
    before = {path: path.read_bytes() for path in smoke.iterdir()}
    for same in (smoke, smoke / ".." / smoke.name):
        assert "folder of the input" in vnca("stylize", model, smoke, "--out", same).complaint
    assert {path: path.read_bytes() for path in smoke.iterdir()} == before


@pytest.mark.usefixtures("no_long_work")
def test_a_run_that_is_there_already(vnca: Vnca, frame: Path, style: Path, model: Path) -> None:
    before = {path: path.read_bytes() for path in model.iterdir()}
    complaint = vnca("train", frame, style, "--out", model).complaint
    assert f"{model}: holds a trained model already" in complaint
    assert "--overwrite" in complaint
    assert {path: path.read_bytes() for path in model.iterdir()} == before


# Models


def test_a_model_of_a_newer_format(vnca: Vnca, smoke: Path, model: Path, out: Path) -> None:
    path = model / MODEL_NAME
    newer = FORMAT_VERSION + 1
    described = {"format_version": newer, "version": "9.0"}
    described |= {"rule": {}, "scales": {}, "training": {}}
    save_file(load_file(path), path, metadata={"vnca": json.dumps(described)})
    for arguments in (["stylize", model, smoke, "--out", out], ["info", model]):
        complaint = vnca(*arguments).complaint
        assert f"{path}: model format {newer} is newer" in complaint
        assert "upgrade vnca" in complaint


def test_a_model_that_is_none(vnca: Vnca, smoke: Path, model: Path, out: Path) -> None:
    path = model / MODEL_NAME
    whole = path.read_bytes()
    for content in (b"no model", whole[:40], whole[:-10]):
        path.write_bytes(content)
        assert f"{path}: not a vnca model" in vnca("stylize", model, smoke, "--out", out).complaint
    assert "is it a training run?" in vnca("stylize", smoke, smoke, "--out", out).complaint
    (smoke / "._ball_0001.vdb").write_bytes(b"as another system leaves it")
    one = (
        f"{smoke}: this folder holds no {MODEL_NAME}; name one of its frames, such as ball_0001.vdb"
    )
    assert one in vnca("info", smoke).complaint


# Options


@pytest.mark.parametrize(
    "arguments",
    [
        ["paint"],
        ["info"],
        ["info", "x.vdb", "--loud"],
        ["train", "frame.vdb", "style.png"],
        ["train", "a.vdb", "b.png", "--out", "c", "--preset", "best"],
        ["train", "a.vdb", "b.png", "--out", "c", "--iterations", "many"],
        ["train", "a.vdb", "b.png", "--out", "c", "--backend", "abacus"],
        ["stylize", "a", "b", "--out", "c", "--backend", "abacus"],
        ["simulate", "volcano", "--out", "c"],
    ],
    ids=" ".join,
)
def test_unknown_commands_and_options(vnca: Vnca, arguments: list[str]) -> None:
    outcome = vnca(*arguments)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    assert arguments[-1].lstrip("-") in outcome.err or "Missing" in outcome.err
    assert len(outcome.err.splitlines()) == 1


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--iterations", "0"),
        ("--learning-rate", "nan"),
        ("--milestones", "150"),
        ("--seed", "-1"),
        ("--hidden", "0"),
        ("--channels", "3"),
        ("--update-probability", "1.5"),
        ("--view.size", "8"),
        ("--pool.size", "0"),
        ("--appearance.style", "-1"),
        ("--appearance.layers", "relu1_1"),
        ("--appearance.style-scale", "0"),
        ("--preview-every", "0"),
        ("--device", "toaster"),
        ("--device", "meta"),
        ("--device", "cuda:99"),
        ("--features", "nothing.pth"),
        ("--features", "clip"),
        ("--fps", "0"),
        ("--velocity-scale", "inf"),
        ("--velocity-grid", "wind"),
        ("--density-grid", "mist"),
    ],
)
def test_training_options_out_of_range(
    vnca: Vnca, frame: Path, style: Path, out: Path, option: str, value: str
) -> None:
    units = ["--velocity-units", "m/s"] if option == "--fps" else []
    short = ["--iterations", "1"]  # should it be taken after all; what comes later wins
    options = [*short, option, value, *units]
    complaint = vnca("train", frame, style, "--out", out, *options).complaint
    name = option.rpartition(".")[2].strip("-")
    assert value == "nothing.pth" or name.replace("-", " ") in complaint.replace("-", " ").replace(
        "_", " "
    )
    assert value in complaint or name in ("learning-rate", "pool.size", "size")


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--strength", "1.5"),
        ("--density-strength", "nan"),
        ("--steps-per-frame", "-1"),
        ("--warmup", "-1"),
        ("--gamma", "0"),
        ("--gamma", "nan"),
        ("--density-scale", "inf"),
        ("--rows", "3"),
        ("--film-fps", "0"),
        ("--film-fps", "inf"),
        ("--field-of-view", "180"),
        ("--elevation", "nan"),
        ("--azimuth", "inf"),
        ("--light", "-1"),
        ("--light-azimuth", "nan"),
        ("--light-elevation", "95"),
        ("--ambient", "1.5"),
        ("--background", "blue"),
        ("--background", "#12345"),
        ("--colour-grid", "density"),
    ],
)
@pytest.mark.usefixtures("no_long_work")
def test_stylizing_options_out_of_range(
    vnca: Vnca, smoke: Path, model: Path, out: Path, option: str, value: str
) -> None:
    assert option in vnca("stylize", model, smoke, "--out", out, option, value).complaint


@pytest.mark.usefixtures("no_long_work")
def test_a_camera_without_a_film_is_refused(
    vnca: Vnca, smoke: Path, model: Path, out: Path
) -> None:
    complaint = vnca("stylize", model, smoke, "--out", out, "--film-fps", 12).complaint
    assert "--film-fps: shapes a film; name one with --preview" in complaint


@pytest.mark.usefixtures("no_long_work")
def test_colour_grids_that_share_a_name(vnca: Vnca, smoke: Path, model: Path, out: Path) -> None:
    stylize = ["stylize", model, smoke, "--out", out, "--colour-grid"]
    assert "--colour-grid Cd Cd" in vnca(*stylize, "Cd", "Cd").complaint
    assert "--colour-grid" in vnca(*stylize).complaint
    renamed = [*stylize, "temperature", "--density-grid", "temperature"]
    assert "--colour-grid" in vnca(*renamed).complaint


@pytest.mark.parametrize(
    ("out_name", "options"),
    [
        ("film.gif", ["--transparent"]),
        ("picture_#.jpg", ["--transparent"]),
        ("film.gif", ["--strip", 2]),
        ("picture.png", ["--turntable", 4]),
        ("film.gif", ["--turntable", -1]),
        ("film.gif", ["--gamma", "nan"]),
        ("film.gif", ["--background", "blue"]),
        ("film.gif", ["--turn", 90, "--turntable", 4]),
        ("picture_#.png", ["--turn", 90]),
        ("strip.png", ["--film-fps", 12, "--strip", 2]),
        ("picture_#.png", ["--background", "#ffffff", "--transparent"]),
        ("film.gif", ["--ambient", 0.5, "--light", 0]),
        ("film.gif", ["--velocity-units", "m/s"]),
        ("film.gif", ["--fps", 12]),
        ("picture.png", []),
    ],
)
@pytest.mark.usefixtures("no_long_work")
def test_rendering_options_that_do_not_fit(
    vnca: Vnca, smoke: Path, tmp_path: Path, out_name: str, options: list[str]
) -> None:
    complaint = vnca("render", smoke, "--out", tmp_path / out_name, *options).complaint
    assert (options[0] if options else "--out") in complaint
    assert not (tmp_path / out_name).exists()


@pytest.mark.parametrize(
    ("option", "value"), [("frames", "0"), ("resolution", "2"), ("seed", "-1")]
)
def test_simulation_options_out_of_range(vnca: Vnca, out: Path, option: str, value: str) -> None:
    complaint = vnca("simulate", "plume", "--out", out, f"--{option}", value).complaint
    assert option in complaint
    assert value in complaint


def test_an_accelerator_that_is_not_there(
    vnca: Vnca, frame: Path, style: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import torch

    if torch.cuda.is_available():
        pytest.skip("there is one")
    complaint = vnca("train", frame, style, "--out", out, "--device", "cuda").complaint
    assert "--device cuda: torch" in complaint
    assert complaint.endswith("use auto or cpu")


def test_frames_that_are_not_there(vnca: Vnca, smoke: Path, model: Path, out: Path) -> None:
    stylize = ["stylize", model, smoke, "--out", out, "--frames"]
    complaint = vnca(*stylize, "30-53").complaint
    assert f"{smoke}: no frame of 30-53" in complaint
    assert "there are 1-3" in complaint
    assert "expected something like 30-53" in vnca(*stylize, "all").complaint
    assert "empty range" in vnca(*stylize, "5-3").complaint
    assert "no file matches" in vnca("stylize", model, smoke / "a_####.vdb", "--out", out).complaint


def test_a_velocity_scale_to_fit_without_a_neighbour(
    vnca: Vnca, frame: Path, style: Path, out: Path
) -> None:
    for other in sorted(frame.parent.iterdir()):
        if other != frame:
            other.unlink()
    arguments = [style, "--out", out, "--velocity-scale", "fit"]
    assert "two neighbouring frames" in vnca("train", frame, *arguments).complaint
    alone = frame.rename(frame.with_name("alone.vdb"))
    (frame.parent / "other_0001.vdb").write_bytes(alone.read_bytes())
    assert "alone.vdb" in vnca("train", alone, *arguments).complaint


# The program itself


def program(*arguments: object) -> subprocess.CompletedProcess[str]:
    vnca = Path(sys.executable).with_name("vnca")
    command = [str(vnca), *map(str, arguments)] if vnca.exists() else []
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def test_the_program_ends_with_one_line_and_its_code(tmp_path: Path, model: Path) -> None:
    done = program("info", tmp_path / "missing.vdb")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"vnca: {tmp_path / 'missing.vdb'}: no such file\n"
    done = program("stylize", model, tmp_path / "none", "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"vnca: {tmp_path / 'none'}: no such file or folder")
    assert done.stderr.count("\n") == 1


def test_running_out_of_memory_is_told(
    vnca: Vnca, frame: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def exhausted(*_: object) -> None:
        raise MemoryError("Unable to allocate 3.2 TiB")

    monkeypatch.setattr("vnca.cli.info.describe", exhausted)
    assert "3.2 TiB" in vnca("info", frame).complaint


def test_a_message_of_several_lines_becomes_one(
    vnca: Vnca, frame: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vnca.core.errors import FileFormatError

    def fail(*_: object) -> None:
        raise FileFormatError("a.vdb: damaged\n  at byte 3")

    monkeypatch.setattr("vnca.cli.info.describe", fail)
    assert vnca("info", frame).complaint == "vnca: a.vdb: damaged at byte 3"
